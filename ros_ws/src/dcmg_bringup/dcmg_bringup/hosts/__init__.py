"""One run over several hosts: which node runs where, and how the command and the hosts talk."""
