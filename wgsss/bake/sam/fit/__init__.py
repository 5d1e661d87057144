"""The selection `fit`, our extension of the paper: senders and weights fitted to M_back under training lights."""
