//! The bytes of a cache entry. They consist of a mark (the first bytes of every entry), a hash of all later bytes, the
//! length of the key, the key, and the content.

/// The mark: the first bytes of every entry. The number at the end of `MARK` is the version of the layout of
/// cache entries.
const MARK: &[u8] = b"raycl's cache 1\n";
const HASH_BYTES: usize = 32;
const LENGTH_BYTES: usize = 4;
/// Number of hexadecimal digits of a key's hash in a file name.
const NAME_DIGITS: usize = 32;

/// Returns the name of the file that contains the cache entry with this kind and key.
pub fn file_name(kind: &str, key: &str) -> String {
    let hash = blake3::hash(key.as_bytes()).to_hex();
    format!("{kind}-{}", &hash[..NAME_DIGITS])
}

/// Returns true if a file name has the form of the names that [`file_name`] makes.
pub fn is_name(name: &str) -> bool {
    let digits = |hash: &str| hash.len() == NAME_DIGITS && hash.bytes().all(|byte| byte.is_ascii_hexdigit());
    name.rsplit_once('-').is_some_and(|(kind, hash)| !kind.is_empty() && digits(hash))
}

/// Returns the bytes of the file of a cache entry: mark, hash, length of the key, key and content.
pub fn sealed(key: &str, content: &[u8]) -> Vec<u8> {
    let length = (key.len() as u32).to_le_bytes();
    let rest = [&length[..], key.as_bytes(), content].concat();
    [MARK, blake3::hash(&rest).as_bytes(), &rest].concat()
}

/// Returns the content of a cache entry's file. Returns `None` if the file does not begin with `MARK` or is too
/// short, if the hash in the file does not match the bytes after it, or if the entry has another key.
pub fn opened(mut file: Vec<u8>, key: &str) -> Option<Vec<u8>> {
    let rest = file.strip_prefix(MARK)?;
    let (hash, rest) = rest.split_at_checked(HASH_BYTES)?;
    if blake3::hash(rest).as_bytes() != hash {
        return None;
    }
    let (length, rest) = rest.split_at_checked(LENGTH_BYTES)?;
    let length = u32::from_le_bytes(length.try_into().ok()?) as usize;
    let (own_key, _) = rest.split_at_checked(length)?;
    if own_key != key.as_bytes() {
        return None;
    }
    Some(file.split_off(MARK.len() + HASH_BYTES + LENGTH_BYTES + length))
}
