//! An FMU ready for use: description and binary.

use crate::archive::{Archive, ArchiveError, Unpacked};
use crate::description::{Interface, ModelDescription, StructuralParameters};
use crate::loader::{CallError, Instance, Library, LoadError};
use crate::signature::Signature;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Error while opening or using an FMU.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// Error in the archive.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// Error while loading the binary.
    #[error("{}: {cause}", path.display())]
    Load {
        /// The file.
        path: PathBuf,
        /// Cause.
        cause: LoadError,
    },
    /// Error from a call.
    #[error(transparent)]
    Call(#[from] CallError),
    /// An instance already exists in this process, and the FMU allows only one.
    #[error("{}: the FMU allows only one instance at a time", .0.display())]
    OnlyOnce(PathBuf),
}

/// The unpacked binary of an FMU, with the data for creating instances.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Binary {
    /// The `.fmu` file.
    pub fmu: PathBuf,
    /// Structural parameters of its instances.
    pub structure: StructuralParameters,
    guid: String,
    only_once: bool,
    library: PathBuf,
    resources: PathBuf,
    signature: Signature,
}

impl Binary {
    /// A binary that the host provides under the name `library`, see `loader/system/wasm.rs`.
    pub fn of_host(fmu: PathBuf, description: &ModelDescription, library: PathBuf, interface: Interface) -> Self {
        Self {
            fmu,
            structure: description.structure.clone(),
            guid: description.guid.clone(),
            only_once: false,
            library,
            resources: PathBuf::from("resources"),
            signature: Signature::new(description, interface),
        }
    }

    fn load(&self, unpacked: Arc<Unpacked>) -> Result<Arc<Library>, FmuError> {
        Library::load(unpacked).map_err(|cause| FmuError::Load { path: self.fmu.clone(), cause })
    }

    /// Returns true if this is the binary for instances of an FMU with these structural parameters, in model exchange or
    /// in another interface.
    pub fn is_of(&self, fmu: &Path, structure: &StructuralParameters, is_exchange: bool) -> bool {
        let is_same_interface = (self.signature.interface == Interface::ModelExchange) == is_exchange;
        self.fmu == fmu && self.structure == *structure && is_same_interface
    }

    /// Loads the library, which another process has unpacked.
    pub fn load_elsewhere(&self) -> Result<Arc<Library>, FmuError> {
        self.load(Unpacked::elsewhere(self.library.clone(), self.resources.clone(), self.signature.clone()).into())
    }

    /// Creates an instance. Fails if the FMU returns no instance, or an instance exists and the FMU allows only one.
    pub fn instantiate(&self, library: &Arc<Library>, name: &str) -> Result<Instance, FmuError> {
        if self.only_once && library.instances() > 0 {
            return Err(FmuError::OnlyOnce(self.fmu.clone()));
        }
        Ok(Instance::instantiate(library, name, &self.guid, false)?)
    }

    /// Returns true if the library calls Python without linking to it.
    pub fn needs_python(&self) -> bool {
        crate::python::undefined_symbol(&self.library).is_some()
    }
}

/// An opened FMU; a clone is another handle to the same FMU.
#[derive(Debug, Clone)]
pub struct Fmu(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    description: ModelDescription,
    binary: Binary,
    unpacked: Arc<Unpacked>,
    library: OnceLock<Arc<Library>>,
}

impl Fmu {
    /// Opens a `.fmu` file for co-simulation: reads its description, unpacks it and loads its binary.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FmuError> {
        Self::open_for(path, Interface::CoSimulation)
    }

    /// Like [`Self::open`], for any interface.
    pub fn open_for(path: impl AsRef<Path>, interface: Interface) -> Result<Self, FmuError> {
        let fmu = Self::unpack_for(path.as_ref(), interface)?;
        fmu.load()?;
        Ok(fmu)
    }

    /// Like [`Self::open`], but loads the binary when the first instance is created. A process without instances
    /// therefore executes no code from the FMU.
    pub fn unpack(path: impl AsRef<Path>) -> Result<Self, FmuError> {
        Self::unpack_for(path.as_ref(), Interface::CoSimulation)
    }

    /// Like [`Self::unpack`], for a master that connects scalars: array elements are variables of the description, see
    /// [`ModelDescription::with_elements`]. The instances have these values of structural parameters. Without an
    /// interface, the FMU is opened for [`ModelDescription::stepped_interface`].
    pub fn unpack_by_element(
        path: impl AsRef<Path>,
        structure: &StructuralParameters,
        interface: Option<Interface>,
    ) -> Result<Self, FmuError> {
        let Self(inner) = Self::unpack_with(path.as_ref(), interface, structure)?;
        let Inner { description, binary, unpacked, .. } = &*inner;
        let (description, binary) = (description.clone().with_elements(), binary.clone());
        Ok(Self(Arc::new(Inner { description, binary, unpacked: Arc::clone(unpacked), library: OnceLock::new() })))
    }

    fn unpack_for(path: &Path, interface: Interface) -> Result<Self, FmuError> {
        Self::unpack_with(path, Some(interface), &StructuralParameters::new())
    }

    fn unpack_with(
        path: &Path,
        interface: Option<Interface>,
        structure: &StructuralParameters,
    ) -> Result<Self, FmuError> {
        let mut archive = Archive::open(path)?;
        let description = archive.description_with(structure)?;
        let interface = interface.unwrap_or(description.stepped_interface());
        let unpacked = Arc::new(archive.unpack(&description, interface)?);
        let capabilities = description.interface(interface);
        let only_once = capabilities.is_some_and(|unit| unit.can_be_instantiated_only_once_per_process);
        let binary = Binary {
            fmu: path.to_path_buf(),
            structure: structure.clone(),
            guid: description.guid.clone(),
            only_once,
            library: unpacked.binary.clone(),
            resources: unpacked.resources.clone(),
            signature: unpacked.signature.clone(),
        };
        Ok(Self(Arc::new(Inner { description, binary, unpacked, library: OnceLock::new() })))
    }

    /// Loads the binary now.
    pub fn load(&self) -> Result<(), FmuError> {
        self.library().map(drop)
    }

    fn library(&self) -> Result<&Arc<Library>, FmuError> {
        let Inner { binary, unpacked, library, .. } = &*self.0;
        if let Some(loaded) = library.get() {
            return Ok(loaded);
        }
        let loaded = binary.load(Arc::clone(unpacked))?;
        Ok(library.get_or_init(|| loaded))
    }

    /// The data with which another process can load the binary.
    pub fn binary(&self) -> &Binary {
        &self.0.binary
    }

    /// The model description.
    pub fn description(&self) -> &ModelDescription {
        &self.0.description
    }

    /// The `.fmu` file.
    pub fn path(&self) -> &Path {
        &self.0.binary.fmu
    }

    /// Creates an instance, which keeps the library loaded. Fails if the binary cannot be loaded, the FMU returns no
    /// instance, or an instance exists and the FMU allows only one.
    pub fn instantiate(&self, name: &str) -> Result<Instance, FmuError> {
        self.0.binary.instantiate(self.library()?, name)
    }
}
