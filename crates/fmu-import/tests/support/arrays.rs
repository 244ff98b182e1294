//! Builds an FMU of FMI 3.0 with arrays, wide integers and Binaries from `arrays.c`.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use zip::write::{SimpleFileOptions, ZipWriter};

use fmu_import::archive::platform_of;
use fmu_import::description::FmiVersion;

/// Compiles and packs the FMU into a folder, as `Arrays.fmu`. Each defect is a macro of `arrays.c`.
pub(crate) fn pack(folder: &Path, defects: &[&str]) -> PathBuf {
    let (source, binary) = (folder.join("arrays.c"), folder.join("arrays.so"));
    std::fs::write(&source, include_str!("../../../fmu-system/tests/data/arrays.c")).unwrap();
    let mut cc = Command::new("cc");
    cc.args(["-O1", "-fPIC", "-shared", "-fvisibility=hidden"]);
    cc.args(defects.iter().map(|defect| format!("-D{defect}")));
    assert!(cc.arg("-o").arg(&binary).arg(&source).status().unwrap().success());
    let path = folder.join("Arrays.fmu");
    let mut zip = ZipWriter::new(File::create(&path).unwrap());
    let mut add = |name: &str, content: &[u8]| {
        zip.start_file(name, SimpleFileOptions::default()).unwrap();
        zip.write_all(content).unwrap();
    };
    add("modelDescription.xml", include_bytes!("../../../fmu-system/tests/data/arrays.xml"));
    let suffix = std::env::consts::DLL_SUFFIX;
    add(&format!("binaries/{}/Arrays{suffix}", platform_of(FmiVersion::V3)), &std::fs::read(&binary).unwrap());
    zip.finish().unwrap();
    path
}
