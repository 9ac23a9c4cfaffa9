//! What is wrong at a step.
