//! What a drive was worth.
