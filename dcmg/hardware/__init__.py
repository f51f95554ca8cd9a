"""An example of data that is not ours: bags as other programs record them, and the mapping that reads them."""
