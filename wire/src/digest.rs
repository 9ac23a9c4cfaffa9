//! What was told and what was recorded, compared in 32 bytes.

use sha2::{Digest as _, Sha256};

use crate::keys::Channel;

/// A digest of messages, whatever the order in which they came: simulator and recorder hear an episode in different orders.
///
/// It is the sum of the messages' SHA-256, as little-endian numbers modulo 2^256; a message counts as often as it came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Digest([u64; 4]);

impl Digest {
    /// Adds a message.
    pub fn add(&mut self, channel: Channel, payload: &[u8]) {
        let mut hash = Sha256::new();
        hash.update(channel.name());
        hash.update([0]);
        hash.update(payload);
        let hash = hash.finalize();
        let mut carry = false;
        for (sum, part) in self.0.iter_mut().zip(hash.as_chunks().0) {
            let (partial, first) = sum.overflowing_add(u64::from_le_bytes(*part));
            let (whole, second) = partial.overflowing_add(u64::from(carry));
            (*sum, carry) = (whole, first || second);
        }
    }

    /// As messages carry it.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8> {
        self.0.iter().flat_map(|part| part.to_le_bytes()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(messages: &[(Channel, &[u8])]) -> Digest {
        let mut digest = Digest::default();
        messages.iter().for_each(|(channel, payload)| digest.add(*channel, payload));
        digest
    }

    #[test]
    fn order_is_nothing_and_all_else_is_something() {
        let messages: [(Channel, &[u8]); 3] = [(Channel::Scene, b"a"), (Channel::Plan, b"b"), (Channel::Plan, b"")];
        let digest = of(&messages);
        let [a, b, c] = messages;
        assert_eq!(of(&[c, a, b]), digest);
        for others in
            [&[a, b][..], &[a, b, c, c], &[a, b, b], &[a, (Channel::Event, b"b"), c], &[a, b, (Channel::Plan, b"\0")]]
        {
            assert_ne!(of(others), digest);
        }
        assert_eq!(Digest::default().to_bytes(), [0; 32]);
    }

    #[test]
    fn it_is_what_the_protocol_says() {
        // In Python: hashlib.sha256(b"plan\0b").digest()
        let hex: String =
            of(&[(Channel::Plan, &b"b"[..])]).to_bytes().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, "27711d213a31bd08a9fcb5d05dc58556efb0efd8cdfb6934d5e04b35df6f3097");
        // And three times: (3 * int.from_bytes(.., "little")) % 2**256
        let hex: String =
            of(&[(Channel::Plan, &b"b"[..]); 3]).to_bytes().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, "75535863ae93371afbf5217219509103ce12cf8a69f33d9d7fa2e39f9d4f91c5");
    }
}
