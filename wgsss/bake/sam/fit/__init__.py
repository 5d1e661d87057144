"""Our choice of senders: those whose weighted sum best reproduces M_back under a set of training lights."""
