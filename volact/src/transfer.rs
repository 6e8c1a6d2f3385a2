//! A camera and a transfer function for a bare volume.
