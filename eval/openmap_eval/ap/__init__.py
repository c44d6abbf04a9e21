"""Average precision of 3-D instances as the ScanNet200 benchmark counts it, on any labelled point cloud."""
