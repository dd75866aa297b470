"""LSL between programs of this machine alone, whether or not it has a network that multicasts."""

LSL_HERE = "[multicast]\nResolveScope=machine\n[lab]\nKnownPeers={localhost}\n[ports]\nIPv6=disable\n"
"""Of a file that the variable LSLAPICFG names."""
