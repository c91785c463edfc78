"""Keys with which only the processes of an arm meet: a keystore in the form of SROS2, made by openssl.

``rights.py`` derives from the contract what each process may do in DDS, ``documents.py`` writes that as
governance and permissions, and ``keystore.py`` makes, renews and exports the keys. SAFETY.md lists what
they do not protect.
"""
