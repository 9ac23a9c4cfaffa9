//! The messages, made from `proto/reloop.proto` when the crate is built. Plain data, unchecked: [`crate::convert`] checks it.

#![allow(missing_docs, reason = "the .proto file holds the words; what has none is named for what it is")]
#![allow(clippy::doc_markdown, reason = "the comments are written for every language's readers")]

include!(concat!(env!("OUT_DIR"), "/reloop.v1.rs"));

/// What a service is asked and answers, made from `proto/service.proto`.
pub mod service {
    include!(concat!(env!("OUT_DIR"), "/service/reloop.service.v1.rs"));
}
