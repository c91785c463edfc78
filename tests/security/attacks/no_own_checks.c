/* Cyclone's access control, but without its checks of this process's own readers, writers and topics. */
#include <dlfcn.h>
#include <stddef.h>
#include <dds/security/dds_security_api.h>

typedef int (*init_t)(const char *, void **, struct ddsi_domaingv *);
typedef int (*finalize_t)(void *);

static void *plugin;

static DDS_Security_boolean writer(
    dds_security_access_control *i, const DDS_Security_PermissionsHandle h, const DDS_Security_DomainId d,
    const DDS_Security_char *t, const DDS_Security_Qos *q, const DDS_Security_PartitionQosPolicy *p,
    const DDS_Security_DataTags *g, DDS_Security_SecurityException *e)
{
    (void)i, (void)h, (void)d, (void)t, (void)q, (void)p, (void)g, (void)e;
    return 1;
}

static DDS_Security_boolean topic(
    dds_security_access_control *i, const DDS_Security_PermissionsHandle h, const DDS_Security_DomainId d,
    const DDS_Security_char *t, const DDS_Security_Qos *q, DDS_Security_SecurityException *e)
{
    (void)i, (void)h, (void)d, (void)t, (void)q, (void)e;
    return 1;
}

int init_access_control(const char *argument, void **context, struct ddsi_domaingv *gv)
{
    plugin = dlopen(PLUGIN, RTLD_NOW);
    if (plugin == NULL)
        return -1;
    int result = ((init_t)dlsym(plugin, "init_access_control"))(argument, context, gv);
    if (result == 0) {
        dds_security_access_control *control = *context;
        control->check_create_datawriter = writer;
        control->check_create_datareader = writer;
        control->check_create_topic = topic;
    }
    return result;
}

int finalize_access_control(void *context)
{
    return ((finalize_t)dlsym(plugin, "finalize_access_control"))(context);
}
