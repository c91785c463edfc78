// A DDS peer of another vendor: Fast DDS, the family of ROS 2's default middleware, on loopback only.
//
// It knows neither ROS nor types: it carries serialized CDR, so the tests see the bytes of the wire unchanged.
// `peer DOMAIN` reads commands from its standard input
//
//   reader|writer TOPIC TYPE reliable|best_effort volatile|transient_local USER_DATA
//   send TOPIC HEX
//
// and writes reports to its standard output
//
//   sample TOPIC HEX | matched reader|writer TOPIC COUNT | incompatible reader|writer TOPIC POLICY
//
// A POLICY is an identifier of the DDS specification. The peer ends at the end of its input.

#include <cstring>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

using Bytes = std::vector<unsigned char>;

static void report(const std::string& line)
{
    static std::mutex mutex;
    std::lock_guard<std::mutex> lock(mutex);
    std::cout << line << std::endl;
}

static std::string to_hex(const Bytes& bytes)
{
    static const char digits[] = "0123456789abcdef";
    std::string text;
    for (unsigned char byte : bytes) {
        text += digits[byte >> 4];
        text += digits[byte & 15];
    }
    return text;
}

static Bytes from_hex(const std::string& text)
{
    Bytes bytes;
    for (size_t i = 0; i + 1 < text.size(); i += 2) {
        bytes.push_back(static_cast<unsigned char>(std::stoi(text.substr(i, 2), nullptr, 16)));
    }
    return bytes;
}

// A type whose samples are already serialized, including the encapsulation header.
class Serialized : public fast::TopicDataType {
public:
    explicit Serialized(const std::string& name)
    {
        setName(name.c_str());
        m_typeSize = 4;
        m_isGetKeyDefined = false;
        auto_fill_type_information(false);
        auto_fill_type_object(false);
    }

    bool serialize(void* data, rtps::SerializedPayload_t* payload) override
    {
        const Bytes& bytes = *static_cast<Bytes*>(data);
        std::memcpy(payload->data, bytes.data(), bytes.size());
        payload->length = static_cast<uint32_t>(bytes.size());
        payload->encapsulation = CDR_LE;
        return true;
    }

    bool deserialize(rtps::SerializedPayload_t* payload, void* data) override
    {
        static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }

    std::function<uint32_t()> getSerializedSizeProvider(void* data) override
    {
        return [data]() { return static_cast<uint32_t>(static_cast<Bytes*>(data)->size()); };
    }

    void* createData() override { return new Bytes; }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

class ReaderListener : public fast::DataReaderListener {
public:
    explicit ReaderListener(std::string topic) : topic_(std::move(topic)) {}

    void on_data_available(fast::DataReader* reader) override
    {
        Bytes bytes;
        fast::SampleInfo info;
        while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
            if (info.valid_data) {
                report("sample " + topic_ + " " + to_hex(bytes));
            }
        }
    }

    void on_subscription_matched(fast::DataReader*, const fast::SubscriptionMatchedStatus& status) override
    {
        report("matched reader " + topic_ + " " + std::to_string(status.current_count));
    }

    void on_requested_incompatible_qos(
        fast::DataReader*, const fast::RequestedIncompatibleQosStatus& status) override
    {
        report("incompatible reader " + topic_ + " " + std::to_string(status.last_policy_id));
    }

private:
    std::string topic_;
};

class WriterListener : public fast::DataWriterListener {
public:
    explicit WriterListener(std::string topic) : topic_(std::move(topic)) {}

    void on_publication_matched(fast::DataWriter*, const fast::PublicationMatchedStatus& status) override
    {
        report("matched writer " + topic_ + " " + std::to_string(status.current_count));
    }

    void on_offered_incompatible_qos(
        fast::DataWriter*, const fast::OfferedIncompatibleQosStatus& status) override
    {
        report("incompatible writer " + topic_ + " " + std::to_string(status.last_policy_id));
    }

private:
    std::string topic_;
};

// The QoS that a command requests, for a reader or a writer.
template <class Qos>
static Qos qos_of(Qos qos, const std::string& reliability, const std::string& durability,
    const std::string& user_data)
{
    qos.reliability().kind =
        reliability == "reliable" ? fast::RELIABLE_RELIABILITY_QOS : fast::BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind =
        durability == "volatile" ? fast::VOLATILE_DURABILITY_QOS : fast::TRANSIENT_LOCAL_DURABILITY_QOS;
    qos.history().kind = fast::KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 10;
    qos.user_data().setValue(Bytes(user_data.begin(), user_data.end()));
    // Samples may have any size.
    qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    return qos;
}

int main(int, char** argv)
{
    auto transport = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    transport->interfaceWhiteList.emplace_back("127.0.0.1");
    transport->maxInitialPeersRange = 32;
    fast::DomainParticipantQos participant_qos = fast::PARTICIPANT_QOS_DEFAULT;
    participant_qos.transport().use_builtin_transports = false;
    participant_qos.transport().user_transports.push_back(transport);
    // As ROS 2 on a single host: probe every participant index on localhost, without multicast.
    rtps::Locator_t localhost;
    rtps::IPLocator::setIPv4(localhost, "127.0.0.1");
    participant_qos.wire_protocol().builtin.initialPeersList.push_back(localhost);
    auto* factory = fast::DomainParticipantFactory::get_instance();
    auto* participant = factory->create_participant(std::stoul(argv[1]), participant_qos);
    auto* publisher = participant->create_publisher(fast::PUBLISHER_QOS_DEFAULT);
    auto* subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);

    std::map<std::string, fast::Topic*> topics;
    std::map<std::string, fast::DataWriter*> writers;
    for (std::string line; std::getline(std::cin, line);) {
        std::istringstream words(line);
        std::string command, name;
        words >> command >> name;
        if (command == "send") {
            std::string hex;
            words >> hex;
            Bytes bytes = from_hex(hex);
            writers.at(name)->write(&bytes);
            continue;
        }
        std::string type, reliability, durability, user_data;
        words >> type >> reliability >> durability;
        std::getline(words >> std::ws, user_data);
        if (topics.count(name) == 0) {
            fast::TypeSupport(new Serialized(type)).register_type(participant);
            topics[name] = participant->create_topic(name, type, fast::TOPIC_QOS_DEFAULT);
        }
        if (command == "reader") {
            auto qos = qos_of(fast::DATAREADER_QOS_DEFAULT, reliability, durability, user_data);
            subscriber->create_datareader(topics[name], qos, new ReaderListener(name));
        } else {
            auto qos = qos_of(fast::DATAWRITER_QOS_DEFAULT, reliability, durability, user_data);
            writers[name] = publisher->create_datawriter(topics[name], qos, new WriterListener(name));
        }
    }
    participant->delete_contained_entities();
    factory->delete_participant(participant);
    return 0;
}
