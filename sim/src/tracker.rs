//! From a plan to the control that is driven.
