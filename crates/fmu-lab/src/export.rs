//! The system as an SSP file. The FMUs in it contain only a description and a WebAssembly module.

use crate::fmus::{Fmus, name_of};
use crate::requests::Failure;
use crate::running::Running;
use fmu_import::archive::ArchiveError;
use fmu_import::wasm;
use fmu_system::export::System;
use fmu_system::plan::Plan;
use fmu_system::run::Component;
use std::io::{self, Cursor, Write};
use std::path::Path;
use std::sync::Arc;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Name and content of the file. The file name contains the platform, because the FMUs in the file have binaries for
/// this platform only.
pub(crate) fn ssp(plan: &Plan, running: &Running, fmus: &Fmus) -> Result<(String, Vec<u8>), Failure> {
    let describe = |component: &Component| {
        let missing = || ArchiveError::new(Path::new(&component.fmu), io::Error::from(io::ErrorKind::NotFound));
        fmus.described(&component.fmu).map(Arc::clone).ok_or_else(missing)
    };
    let mut plan = plan.clone();
    plan.simulation = running.simulation;
    // The outputs of the system are the columns of the plan. The other columns are only for the CSV file.
    let mut run = running.run.clone();
    run.columns.truncate(plan.columns.len());
    let system = System::described(&plan, &run, &describe).map_err(Failure::new)?;
    let copy = |file: &str, output: &mut dyn Write| output.write_all(&fmu(file, fmus)?);
    let file = system.write_ssp(Cursor::new(Vec::new()), &copy).map_err(Failure::new)?;
    Ok((format!("{}_wasm32.ssp", system.name), file.into_inner()))
}

/// An archive with the description and the module of an FMU.
fn fmu(file: &str, fmus: &Fmus) -> io::Result<Vec<u8>> {
    let name = name_of(file);
    let description = fmus.described(file).zip(fmus.text(name));
    let (description, text) = description.ok_or(io::ErrorKind::NotFound)?;
    let identifier = description.model_identifier(description.stepped_interface()).unwrap_or(name);
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    zip.start_file("modelDescription.xml", options)?;
    zip.write_all(text.as_bytes())?;
    zip.start_file(wasm::entry(identifier), options)?;
    zip.write_all(&crate::exports::module(name))?;
    Ok(zip.finish()?.into_inner())
}
