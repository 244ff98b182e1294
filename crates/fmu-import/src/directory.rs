//! Strict reader of the central directory of a zip archive.
//!
//! Zip readers disagree about archives with two end records, different numbers in the end record and the zip64 end
//! record, repeated names, or overlapping entries: one reader may check a file and another may unpack a different one.
//! This reader rejects such archives. [`crate::archive`] compares its list of entries with the `zip` crate's.
//!
//! Source: APPNOTE.TXT 6.3.10 of PKWARE, sections 4.3 and 4.5.3.

use std::collections::HashSet;
use std::io::{self, Read, Seek, SeekFrom};

pub(crate) const MAX_ENTRIES: u64 = 100_000;
/// Maximum size of the central directory, bytes. An entry usually has about 100 bytes.
const MAX_DIRECTORY: u64 = 64 << 20;

const LOCAL: &[u8] = b"PK\x03\x04";
const CENTRAL: &[u8] = b"PK\x01\x02";
const END: &[u8] = b"PK\x05\x06";
const END_64: &[u8] = b"PK\x06\x06";
const LOCATOR_64: &[u8] = b"PK\x06\x07";

/// Sizes of the records without their variable parts, bytes.
const LOCAL_BYTES: usize = 30;
const CENTRAL_BYTES: usize = 46;
const END_BYTES: usize = 22;
const END_64_BYTES: usize = 56;
const LOCATOR_64_BYTES: usize = 20;

#[derive(Debug, thiserror::Error)]
pub(crate) enum DirectoryError {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error("not a readable archive: not a zip archive, or truncated or damaged ({0})")]
    Damaged(String),
    #[error("rejected: {0}")]
    Rejected(String),
}

#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Name as written.
    pub(crate) name: Vec<u8>,
    /// Size in the archive, bytes.
    pub(crate) compressed: u64,
    /// Declared unpacked size, bytes.
    pub(crate) size: u64,
    /// Position of the local header.
    pub(crate) header: u64,
}

impl Entry {
    fn shown(&self) -> String {
        String::from_utf8_lossy(&self.name).into_owned()
    }
}

/// Reads little-endian numbers in a record, which must be long enough.
#[derive(Clone, Copy)]
struct Record<'a>(&'a [u8]);

impl Record<'_> {
    fn number(self, at: usize, bytes: usize) -> u64 {
        self.0[at..at + bytes].iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
    }

    fn u16(self, at: usize) -> u64 {
        self.number(at, 2)
    }

    fn u32(self, at: usize) -> u64 {
        self.number(at, 4)
    }

    fn u64(self, at: usize) -> u64 {
        self.number(at, 8)
    }

    fn length(self, at: usize) -> usize {
        usize::from(u16::from_le_bytes([self.0[at], self.0[at + 1]]))
    }
}

#[derive(Debug)]
struct Place {
    entries: u64,
    start: u64,
    size: u64,
}

/// Reads all entries, in the order of the central directory. Fails if the file cannot be read, is not a zip archive, is
/// ambiguous, or has more than [`MAX_ENTRIES`] entries.
pub(crate) fn read<R: Read + Seek>(file: &mut R) -> Result<Vec<Entry>, DirectoryError> {
    let place = find(file)?;
    if place.entries > MAX_ENTRIES {
        return Err(rejected(format!("{} entries, at most {MAX_ENTRIES} are accepted", place.entries)));
    }
    if place.size > MAX_DIRECTORY {
        let message = format!("the list of its entries has {} bytes, at most {MAX_DIRECTORY} are read", place.size);
        return Err(rejected(message));
    }
    let entries = entries(&bytes(file, place.start, place.size)?, place.entries)?;
    let mut names = HashSet::new();
    if let Some(entry) = entries.iter().find(|entry| !names.insert(&entry.name)) {
        return Err(rejected(format!("the entry `{}` appears twice", entry.shown())));
    }
    check_contents(file, &entries, place.start)?;
    Ok(entries)
}

fn damaged(message: impl Into<String>) -> DirectoryError {
    DirectoryError::Damaged(message.into())
}

fn rejected(message: impl Into<String>) -> DirectoryError {
    DirectoryError::Rejected(message.into())
}

/// Reads bytes from the file; the caller must limit the size.
fn bytes<R: Read + Seek>(file: &mut R, start: u64, size: u64) -> Result<Vec<u8>, DirectoryError> {
    file.seek(SeekFrom::Start(start))?;
    let mut bytes = Vec::new();
    file.by_ref().take(size).read_to_end(&mut bytes)?;
    if bytes.len() as u64 == size { Ok(bytes) } else { Err(damaged("it ends within its list of entries")) }
}

/// Finds the central directory with the end record and, if present, the zip64 end record.
fn find<R: Read + Seek>(file: &mut R) -> Result<Place, DirectoryError> {
    let length = file.seek(SeekFrom::End(0))?;
    let tail_start = length.saturating_sub((LOCATOR_64_BYTES + END_BYTES + usize::from(u16::MAX)) as u64);
    let tail = bytes(file, tail_start, length - tail_start)?;
    let signed: Vec<usize> =
        tail.windows(END.len()).enumerate().filter(|(_, window)| *window == END).map(|(at, _)| at).collect();
    let is_end = |at: &usize| tail.len() >= at + END_BYTES && at + END_BYTES + comment(&tail[*at..]) == tail.len();
    let ends: Vec<usize> = signed.iter().copied().filter(is_end).collect();
    let at = match ends[..] {
        [] => return Err(damaged("the end record is missing")),
        [at] if signed.last() == Some(&at) => at,
        // One end record is in the comment of another. Some readers use the first, some the last.
        _ => return Err(rejected("it has several end records; other programs may find other files in it")),
    };
    let end = Record(&tail[at..]);
    if end.u16(4) != 0 || end.u16(6) != 0 || end.u16(8) != end.u16(10) {
        return Err(damaged("it is a part of a split archive"));
    }
    let mut place = Place { entries: end.u16(10), start: end.u32(16), size: end.u32(12) };
    let mut directory_end = tail_start + at as u64;
    if at >= LOCATOR_64_BYTES && tail[at - LOCATOR_64_BYTES..].starts_with(LOCATOR_64) {
        let locator = tail_start + (at - LOCATOR_64_BYTES) as u64;
        let position = Record(&tail[at - LOCATOR_64_BYTES..]).u64(8);
        let wide = end_64(file, position, locator)?;
        for (what, narrow, wide, most) in [
            ("entries", place.entries, wide.entries, u64::from(u16::MAX)),
            ("as the length of the list", place.size, wide.size, u64::from(u32::MAX)),
            ("as the start of the list", place.start, wide.start, u64::from(u32::MAX)),
        ] {
            if narrow != most && narrow != wide {
                let message = format!("its end record contains {narrow} {what}, its zip64 end record {wide}");
                return Err(rejected(message));
            }
        }
        (place, directory_end) = (wide, position);
    }
    if place.start.checked_add(place.size) != Some(directory_end) {
        return Err(damaged("the list of its entries is not where the end record says"));
    }
    Ok(place)
}

fn comment(end: &[u8]) -> usize {
    Record(end).length(20)
}

/// Reads the zip64 end record at a position. The record must end where its locator starts.
fn end_64<R: Read + Seek>(file: &mut R, position: u64, locator: u64) -> Result<Place, DirectoryError> {
    let wrong = || damaged("the zip64 end record is not where its locator says");
    if locator.checked_sub(position).is_none_or(|bytes| bytes < END_64_BYTES as u64) {
        return Err(wrong());
    }
    let record = bytes(file, position, END_64_BYTES as u64)?;
    let record = Record(&record);
    if !record.0.starts_with(END_64) || record.u64(4).checked_add(position + 12) != Some(locator) {
        return Err(wrong());
    }
    if record.u32(16) != 0 || record.u32(20) != 0 || record.u64(24) != record.u64(32) {
        return Err(damaged("it is a part of a split archive"));
    }
    Ok(Place { entries: record.u64(32), start: record.u64(48), size: record.u64(40) })
}

/// Reads the records in a central directory, which must not contain other bytes.
fn entries(mut directory: &[u8], count: u64) -> Result<Vec<Entry>, DirectoryError> {
    let mut entries = Vec::new();
    while !directory.is_empty() {
        if directory.len() < CENTRAL_BYTES || !directory.starts_with(CENTRAL) {
            return Err(damaged(format!("entry {} of its list is damaged", entries.len() + 1)));
        }
        let record = Record(directory);
        let name = CENTRAL_BYTES..CENTRAL_BYTES + record.length(28);
        let extra = name.end..name.end + record.length(30);
        let end = extra.end + record.length(32);
        if directory.len() < end {
            return Err(damaged(format!("entry {} of its list is cut off", entries.len() + 1)));
        }
        let [mut size, mut compressed, mut header] = [24, 20, 42].map(|at| record.u32(at));
        widen(&directory[extra], [&mut size, &mut compressed, &mut header]);
        entries.push(Entry { name: directory[name].to_vec(), compressed, size, header });
        directory = &directory[end..];
    }
    if entries.len() as u64 != count {
        let message = format!("it lists {} entries, but its end record contains {count}", entries.len());
        return Err(rejected(message));
    }
    Ok(entries)
}

/// Replaces numbers that do not fit in 32 bits with the numbers in the zip64 field, which contains no others.
fn widen(mut extra: &[u8], numbers: [&mut u64; 3]) {
    const ZIP_64: u64 = 1;
    while extra.len() >= 4 {
        let (id, length) = (Record(extra).u16(0), Record(extra).length(2));
        let end = extra.len().min(4 + length);
        if id == ZIP_64 {
            let mut field = extra[4..end].chunks_exact(8);
            for number in numbers {
                if *number == u64::from(u32::MAX)
                    && let Some(wide) = field.next()
                {
                    *number = Record(wide).u64(0);
                }
            }
            return;
        }
        extra = &extra[end..];
    }
}

/// Checks that local headers and central directory contain the same names, and that entries do not overlap.
fn check_contents<R: Read + Seek>(file: &mut R, entries: &[Entry], end: u64) -> Result<(), DirectoryError> {
    let mut in_order: Vec<&Entry> = entries.iter().collect();
    in_order.sort_by_key(|entry| entry.header);
    let mut free = 0;
    let mut before: Option<&Entry> = None;
    for entry in in_order {
        if entry.header < free {
            let other = before.map(Entry::shown).unwrap_or_default();
            return Err(rejected(format!("the entries `{other}` and `{}` overlap", entry.shown())));
        }
        let missing = || damaged(format!("the entry `{}` is not where the list of entries says", entry.shown()));
        let fixed = bytes(file, entry.header, LOCAL_BYTES as u64).map_err(|_| missing())?;
        let header = Record(&fixed);
        if !fixed.starts_with(LOCAL) {
            return Err(missing());
        }
        let mut name = vec![0; header.length(26)];
        file.read_exact(&mut name).map_err(|_| missing())?;
        if name != entry.name {
            let other = String::from_utf8_lossy(&name);
            let message = format!("the entry `{}` has another name, `{other}`, in its local header", entry.shown());
            return Err(rejected(message));
        }
        let content = entry.header + LOCAL_BYTES as u64 + header.u16(26) + header.u16(28);
        free = content.saturating_add(entry.compressed);
        if free > end {
            return Err(rejected(format!("the entry `{}` overlaps with the list of entries", entry.shown())));
        }
        before = Some(entry);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes of the entries, and the records of the central directory.
    #[derive(Default)]
    struct Zip {
        bytes: Vec<u8>,
        /// Records of the central directory.
        list: Vec<Vec<u8>>,
    }

    fn little<const N: usize>(numbers: [(u64, usize); N]) -> Vec<u8> {
        numbers.iter().flat_map(|(number, bytes)| number.to_le_bytes()[..*bytes].to_vec()).collect()
    }

    impl Zip {
        /// Two valid entries, `a` and `b`.
        fn sound() -> Self {
            let mut zip = Self::default();
            zip.add("a", b"text");
            zip.add("b", b"");
            zip
        }

        fn add(&mut self, name: &str, content: &[u8]) {
            let header = self.bytes.len() as u64;
            self.local(name);
            self.bytes.extend(content);
            self.list(name, content.len() as u64, header, &[]);
        }

        fn local(&mut self, name: &str) {
            self.bytes.extend([LOCAL, &[0; 22], &little([(name.len() as u64, 2), (0, 2)]), name.as_bytes()].concat());
        }

        fn list(&mut self, name: &str, size: u64, header: u64, extra: &[u8]) {
            let [narrow_size, narrow_header] = [size, header].map(|number| number.min(u64::from(u32::MAX)));
            let numbers = little([
                (narrow_size, 4),
                (narrow_size, 4),
                (name.len() as u64, 2),
                (extra.len() as u64, 2),
                (0, 8),
                (0, 2),
                (narrow_header, 4),
            ]);
            self.list.push([CENTRAL, &[0; 16], &numbers, name.as_bytes(), extra].concat());
        }

        fn end(count: usize, size: usize, start: usize, comment: &[u8]) -> Vec<u8> {
            let [count, size, start] = [count, size, start].map(|number| number as u64);
            let numbers = little([(0, 4), (count, 2), (count, 2), (size, 4), (start, 4), (comment.len() as u64, 2)]);
            [END, &numbers, comment].concat()
        }

        fn end_64(count: usize, size: usize, start: usize, locator: usize) -> Vec<u8> {
            let [count, size, start, locator] = [count, size, start, locator].map(|number| number as u64);
            let record = little([(44, 8), (0, 4), (0, 8), (count, 8), (count, 8), (size, 8), (start, 8)]);
            [END_64, &record, LOCATOR_64, &little([(0, 4), (locator, 8), (1, 4)])].concat()
        }

        fn finished(&self, comment: &[u8]) -> Vec<u8> {
            let list = self.list.concat();
            let end = Self::end(self.list.len(), list.len(), self.bytes.len(), comment);
            [&self.bytes[..], &list, &end].concat()
        }

        /// Returns the file with a zip64 end record after the list of entries, and with the given numbers in the
        /// ordinary end record.
        fn finished_64(&self, count_64: usize, [count, size, start]: [usize; 3]) -> Vec<u8> {
            let list = self.list.concat();
            let at = self.bytes.len() + list.len();
            let wide = Self::end_64(count_64, list.len(), self.bytes.len(), at);
            [&self.bytes[..], &list, &wide, &Self::end(count, size, start, b"")].concat()
        }
    }

    const NARROW: [usize; 3] = [0xffff, 0xffff_ffff, 0xffff_ffff];

    fn names(bytes: Vec<u8>) -> Vec<String> {
        read(&mut io::Cursor::new(bytes)).expect("a sound archive").iter().map(Entry::shown).collect()
    }

    #[track_caller]
    fn rejects(bytes: Vec<u8>, expected: &str) {
        match read(&mut io::Cursor::new(bytes)).expect_err(expected) {
            DirectoryError::Rejected(message) | DirectoryError::Damaged(message) => {
                assert!(message.contains(expected), "{expected}: {message}");
            }
            DirectoryError::Io(error) => panic!("{expected}: {error}"),
        }
    }

    #[test]
    fn valid_archives_are_read() {
        let zip = Zip::sound();
        assert_eq!(names(zip.finished(b"")), ["a", "b"]);
        assert_eq!(names(zip.finished(b"a comment")), ["a", "b"]);
        assert_eq!(names(zip.finished(&vec![b'x'; 0xffff])), ["a", "b"]);
        assert_eq!(names(zip.finished_64(2, NARROW)), ["a", "b"]);
        assert_eq!(names(zip.finished_64(2, [2, zip.list.concat().len(), zip.bytes.len()])), ["a", "b"]);
        assert_eq!(names(Zip::default().finished(b"")), [""; 0]);
        // The `zip` crate reads the same entries.
        for bytes in [zip.finished(b""), zip.finished_64(2, NARROW)] {
            let read = zip::ZipArchive::new(io::Cursor::new(bytes)).unwrap();
            assert_eq!(read.file_names().map(Result::unwrap).collect::<Vec<_>>(), ["a", "b"]);
        }
        // An uncompressed zip file inside the archive contains zip records, too.
        let mut outer = Zip::default();
        outer.add("inner.zip", &zip.finished(b""));
        assert_eq!(names(outer.finished(b"")), ["inner.zip"]);
    }

    #[test]
    fn numbers_of_zip64_replace_those_that_do_not_fit() {
        let mut zip = Zip::default();
        zip.local("a");
        let wide = little([(1, 2), (24, 2), (0, 8), (0, 8), (0, 8)]);
        let other = little([(0x5455, 2), (1, 2), (0, 1)]);
        zip.list("a", u64::MAX, u64::MAX, &[other, wide].concat());
        assert_eq!(names(zip.finished(b"")), ["a"]);
        // Without the zip64 field, the 32-bit numbers apply.
        zip.list[0].truncate(CENTRAL_BYTES + 1);
        zip.list[0][30..32].fill(0);
        rejects(zip.finished(b""), "the entry `a` is not where the list of entries says");
    }

    #[test]
    fn repeated_names_are_rejected() {
        let mut zip = Zip::sound();
        zip.add("a", b"other text");
        rejects(zip.finished(b""), "the entry `a` appears twice");
        rejects(zip.finished_64(3, NARROW), "the entry `a` appears twice");
        // The second entry is hidden by a wrong number of entries in one of the end records.
        rejects(zip.finished_64(2, NARROW), "it lists 3 entries, but its end record contains 2");
        let real = [3, zip.list.concat().len(), zip.bytes.len()];
        rejects(zip.finished_64(2, real), "its end record contains 3 entries, its zip64 end record 2");
        let (list, start) = (zip.list.concat(), zip.bytes.len());
        let short = [&zip.bytes[..], &list, &Zip::end(2, list.len(), start, b"")].concat();
        rejects(short, "it lists 3 entries, but its end record contains 2");
    }

    /// Some programs use the first end record, some the last, some the zip64 end record.
    #[test]
    fn a_second_list_of_entries_is_rejected() {
        let zip = Zip::sound();
        let other = Zip::default().finished(b"");
        rejects(zip.finished(&other), "it has several end records");
        rejects(zip.finished(b"PK\x05\x06"), "it has several end records");
        rejects([zip.finished(b""), other].concat(), "the list of its entries is not where");
        rejects(zip.finished_64(2, [0, 0, 0]), "its end record contains 0 entries, its zip64 end record 2");
        let start = zip.bytes.len() + 1;
        rejects(
            zip.finished_64(2, [2, zip.list.concat().len(), start]),
            "as the start of the list, its zip64 end record",
        );
        rejects([zip.finished(b""), b"more".to_vec()].concat(), "the end record is missing");
        rejects([b"before".to_vec(), zip.finished(b"")].concat(), "the list of its entries is not where");
        let mut moved = zip.finished_64(2, NARROW);
        let locator = moved.len() - END_BYTES - LOCATOR_64_BYTES;
        moved[locator + 8] += 1;
        rejects(moved, "the zip64 end record is not where its locator says");
    }

    /// From "A better zip bomb" (David Fifield, WOOT 2019): every entry contains all entries after it.
    #[test]
    fn entries_that_overlap_are_rejected() {
        let mut zip = Zip::default();
        let (count, header) = (5000, LOCAL_BYTES as u64 + 4);
        for i in 0..count {
            zip.local(&format!("{i:04}"));
            zip.list(&format!("{i:04}"), (count - 1 - i) * header, i * header, &[]);
        }
        rejects(zip.finished(b""), "the entries `0000` and `0001` overlap");

        let mut zip = Zip::sound();
        zip.list("c", 0, 0, &[]);
        rejects(zip.finished(b""), "the entries `a` and `c` overlap");
        let mut zip = Zip::sound();
        zip.list.pop();
        let header = zip.bytes.len() as u64 - LOCAL_BYTES as u64 - 1;
        zip.list("b", 20, header, &[]);
        rejects(zip.finished(b""), "the entry `b` overlaps with the list of entries");
    }

    #[test]
    fn an_entry_with_two_names_is_rejected() {
        let mut zip = Zip::sound();
        zip.list[1][CENTRAL_BYTES] = b'c';
        rejects(zip.finished(b""), "the entry `c` has another name, `b`, in its local header");
    }

    #[test]
    fn limits() {
        rejects(Zip::default().finished_64(100_001, NARROW), "100001 entries, at most 100000 are accepted");
        let most = 64 << 20;
        let large = [vec![0; most + 1], Zip::end(1, most + 1, 0, b"")].concat();
        rejects(large, "the list of its entries has 67108865 bytes, at most 67108864 are read");
    }

    #[test]
    fn truncated_archives_are_damaged() {
        let bytes = Zip::sound().finished_64(2, NARROW);
        for length in 0..bytes.len() {
            let error = read(&mut io::Cursor::new(&bytes[..length])).expect_err("cut off");
            assert!(matches!(error, DirectoryError::Damaged(_)), "{length}: {error:?}");
        }
    }
}
