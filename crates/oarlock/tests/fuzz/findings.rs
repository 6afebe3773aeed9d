//! What fuzzing found, each kept as a test of its own.
