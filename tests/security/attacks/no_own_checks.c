/* Cyclone's access control, but without its checks of this process's own readers, writers and topics.

It shows others the permissions in the file SHOWN_PERMISSIONS, if this variable is set, instead of its own. */
#include <dlfcn.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <dds/security/dds_security_api.h>

typedef int (*init_t)(const char *, void **, struct ddsi_domaingv *);
typedef int (*finalize_t)(void *);

static void *plugin;
static DDS_Security_access_control_get_permissions_credential_token own;

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

static DDS_Security_boolean shown(
    dds_security_access_control *i, DDS_Security_PermissionsCredentialToken *t,
    const DDS_Security_PermissionsHandle h, DDS_Security_SecurityException *e)
{
    DDS_Security_boolean result = own(i, t, h, e);
    FILE *file = fopen(getenv("SHOWN_PERMISSIONS"), "r");
    char *text = calloc(1, 65536);
    if (file == NULL || text == NULL || fread(text, 1, 65535, file) == 0)
        abort();
    fclose(file);
    free(t->properties._buffer[0].value);
    t->properties._buffer[0].value = text;
    return result;
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
        own = control->get_permissions_credential_token;
        if (getenv("SHOWN_PERMISSIONS"))
            control->get_permissions_credential_token = shown;
    }
    return result;
}

int finalize_access_control(void *context)
{
    return ((finalize_t)dlsym(plugin, "finalize_access_control"))(context);
}
