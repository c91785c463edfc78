# shellcheck shell=sh
# Sourced by each command in the checkout, before it runs Python.

# root's files would stop the next start of the checkout's owner. In a user namespace, root may see another owner:
# there it cannot write, and leaves nothing behind.
if [ "$(id -u)" = 0 ] && ids=$(stat -c %u:%g .) && [ "${ids%:*}" != 0 ] && [ -w . ]; then
    owner=$(stat -c %U .)
    be="runuser -u $owner -- make ..."
    [ "$owner" != UNKNOWN ] || be="setpriv --reuid=${ids%:*} --regid=${ids#*:} --clear-groups make ..."
    echo "You are root, and $PWD belongs to $owner (uid ${ids%:*}), who cannot replace the files of root." \
        "As $owner: $be; in a container: docker run --user $ids; or take it: chown -R root '$PWD'" >&2
    exit 1
fi

# What Python reads before any module, and what would make this shell a process of an arm (deploy/supervision/variables.py).
for name in $(env | sed -n 's/^\(PYTHON[A-Z0-9_]*\|SUPERVISOR_[A-Z0-9_]*\|REACTIVE_ARM_SYSTEM\)=.*/\1/p'); do
    case $name in
    PYTHON | PYTHONPATH | PYTHONDONTWRITEBYTECODE | PYTHONPYCACHEPREFIX | PYTHONFAULTHANDLER) ;;
    PYTHONNOUSERSITE | PYTHONUSERBASE) ;;
    *) unset "$name" ;;
    esac
done
