//! Stores compiled OpenCL programs in raycl's cache.

use crate::cache::Cache;
use crate::device::DeviceInfo;

/// The kind of the cache entries that contain programs.
const KIND: &str = "program";
/// The kind of the cache entries that contain the key under which a compiled program is stored. raycl finds
/// such an entry by the program's name. The name is a text that identifies the program before the program's
/// key is known. If a program uses a tree, one of its defines (the stack size), and thus its key, is known
/// only once the tree is built. By the program's name, raycl can find out, before it builds the tree, whether
/// the program is stored.
const NAME_KIND: &str = "name";

/// The environment variable with which raycl starts a process again after a crash that a stored program may have
/// caused. The new process compiles the programs that it needs, and removes the stored versions of these programs.
pub const AFRESH: &str = "RAYCL_COMPILE_AFRESH";

/// The cache for the compiled programs of one device. `ProgramCache::default()` stores nothing.
#[derive(Clone, Debug, Default)]
pub struct ProgramCache {
    cache: Cache,
    /// Everything besides a program's source and options that affects the compiled code.
    compiler: String,
    at_hand: bool,
    /// True if this process removes stored programs instead of loading them (see [`AFRESH`]).
    afresh: bool,
}

/// A compiled program from the cache.
pub struct StoredProgram {
    /// The messages that the compiler printed when it compiled the program.
    pub log: String,
    /// The binary from which the driver loads the program.
    pub binary: Vec<u8>,
}

impl ProgramCache {
    /// Returns the cache for the compiled programs of a device and its driver.
    pub fn of(cache: Cache, device: &DeviceInfo) -> Self {
        let afresh = std::env::var_os(AFRESH).is_some();
        Self { cache, compiler: device.compiler(), at_hand: device.has_binaries_at_hand(), afresh }
    }

    /// Returns the key under which a program is stored.
    pub fn key(&self, source: &str, options: &str) -> String {
        format!("{}\n{options}\n{}", self.compiler, blake3::hash(source.as_bytes()).to_hex())
    }

    /// Returns true if the cache can store programs.
    pub fn is_usable(&self) -> bool {
        self.cache.is_usable()
    }

    /// Returns true if the driver can return a compiled program's binary without compiling again.
    pub fn has_binaries_at_hand(&self) -> bool {
        self.at_hand
    }

    /// Returns the program stored under a key; `None` if no program is stored, or if this process removes
    /// stored programs ([`AFRESH`]).
    pub fn find(&self, key: &str) -> Option<StoredProgram> {
        if self.afresh {
            return None;
        }
        StoredProgram::from_bytes(&self.cache.get(KIND, key)?)
    }

    /// Removes the program stored under a key, if an earlier process may have crashed because of a stored
    /// program ([`AFRESH`]).
    pub fn distrust(&self, key: &str) {
        if self.afresh && self.cache.get(KIND, key).is_some() {
            // The program's entry is replaced by an entry without content, which `find` does not accept as a
            // program.
            self.cache.put(KIND, key, &[]);
        }
    }

    /// Stores the key of a program under the program's name.
    pub fn name(&self, name: &str, key: &str) {
        self.cache.put(NAME_KIND, &self.name_key(name), key.as_bytes());
    }

    /// Returns true if the program with the given name is stored.
    pub fn has(&self, name: &str) -> bool {
        let key = self.cache.get(NAME_KIND, &self.name_key(name)).and_then(|key| String::from_utf8(key).ok());
        key.is_some_and(|key| self.find(&key).is_some())
    }

    fn name_key(&self, name: &str) -> String {
        format!("{}\n{name}", self.compiler)
    }

    /// Stores a program under a key. Returns true if the program was stored.
    pub fn store(&self, key: &str, program: &StoredProgram) -> bool {
        self.cache.put(KIND, key, &program.to_bytes())
    }
}

impl StoredProgram {
    fn to_bytes(&self) -> Vec<u8> {
        let length = (self.log.len() as u64).to_le_bytes();
        [&length[..], self.log.as_bytes(), &self.binary].concat()
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (length, rest) = bytes.split_first_chunk::<8>()?;
        let (log, binary) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        Some(Self { log: String::from_utf8(log.to_vec()).ok()?, binary: binary.to_vec() })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::device::{DeviceKind, tests::example};

    fn programs_of(cache: &Cache, device: &DeviceInfo) -> ProgramCache {
        ProgramCache::of(cache.clone(), device)
    }

    #[test]
    fn a_program_comes_back_for_the_same_text_options_device_driver_and_variables_alone() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(&folder.path().join("raycl"), 1 << 20);
        let device = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let programs = programs_of(&cache, &device);
        let program = StoredProgram { log: "said".into(), binary: vec![1, 2, 3] };
        assert!(programs.store(&programs.key("text", "-D A=1"), &program));
        let stored = |device: &DeviceInfo, source, options| {
            let programs = programs_of(&cache, device);
            programs.find(&programs.key(source, options)).map(|program| (program.log, program.binary))
        };
        assert_eq!(stored(&device, "text", "-D A=1"), Some(("said".to_owned(), vec![1, 2, 3])));
        assert_eq!(stored(&device, "text ", "-D A=1"), None);
        assert_eq!(stored(&device, "text", "-D A=2"), None);
        let changed: [fn(&mut DeviceInfo); 5] = [
            |device| device.name = "another".into(),
            |device| device.driver = "3.2".into(),
            |device| device.platform_version = "OpenCL 3.0 PoCL 3.2".into(),
            |device| device.platform = "Another".into(),
            |device| device.settings.push("POCL_WORK_GROUP_METHOD=cbs".into()),
        ];
        for change in changed {
            let mut other = device.clone();
            change(&mut other);
            assert_eq!(stored(&other, "text", "-D A=1"), None, "{other:?}");
        }
    }

    #[test]
    fn after_a_crash_a_stored_program_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(folder.path(), 1 << 20);
        let programs = programs_of(&cache, &example("PoCL", "cpu", DeviceKind::Cpu, 2));
        let program = |byte| StoredProgram { log: String::new(), binary: vec![byte] };
        assert!(programs.store("key", &program(1)));
        let afresh = ProgramCache { afresh: true, ..programs.clone() };
        assert!(afresh.find("key").is_none());
        programs.distrust("key");
        assert!(programs.find("key").is_some(), "no process has crashed");
        afresh.distrust("key");
        assert!(programs.find("key").is_none());
        assert!(afresh.store("key", &program(2)));
        assert_eq!(programs.find("key").unwrap().binary, [2]);
    }

    #[test]
    fn a_name_finds_a_program_of_the_same_driver_as_long_as_it_is_stored() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(folder.path(), 1 << 20);
        let device = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let programs = programs_of(&cache, &device);
        programs.name("hash", "key");
        assert!(!programs.has("hash"), "the program itself is missing");
        programs.store("key", &StoredProgram { log: String::new(), binary: vec![1] });
        let other = programs_of(&cache, &DeviceInfo { driver: "3.2".into(), ..device });
        assert_eq!([programs.has("hash"), programs.has("another"), other.has("hash")], [true, false, false]);
    }

    #[test]
    fn bytes_that_are_no_program_are_none() {
        for bytes in
            [&b""[..], b"1234567", &[255; 8], &[9, 0, 0, 0, 0, 0, 0, 0, 1], &[1, 0, 0, 0, 0, 0, 0, 0, 255]]
        {
            assert!(StoredProgram::from_bytes(bytes).is_none(), "{bytes:?}");
        }
    }
}
