//! What is ready of a file that is being made: beside FILE a folder FILE.parts, with a file of windows for each scene. So an interrupted
//! command goes on, and the bytes do not depend on who was ready first.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

use super::error::WindowsError;
use super::file::WindowsFile;
use super::head::{Head, Place, SceneRecord, Skipped};
use super::prepare::PrepareError;
use super::recipe::{Piece, Pieces};
use super::split::Role;

/// The folder, locked.
#[derive(Debug)]
pub(super) struct Parts {
    folder: PathBuf,
    settings: String,
    /// The settings' file, locked as long as it is open: nobody else works here meanwhile.
    _lock: File,
}

const SETTINGS: &str = "settings.toml";

impl Parts {
    /// Those of `out`. Parts that were made by other settings are removed.
    pub fn open(out: &Path, settings: String) -> Result<Self, PrepareError> {
        let mut folder = out.as_os_str().to_owned();
        folder.push(".parts");
        let folder = PathBuf::from(folder);
        fs::create_dir_all(&folder).map_err(at(&folder))?;
        let path = folder.join(SETTINGS);
        let failed = at(&path);
        let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = options.map_err(&failed)?;
        // Where locks are not to be had, two at once are the user's affair.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(PrepareError::Busy(out.into()));
        }
        let mut there = Vec::new();
        file.read_to_end(&mut there).map_err(&failed)?;
        if there != settings.as_bytes() {
            remove_parts(&folder)?;
            file.rewind()
                .and_then(|()| file.set_len(0))
                .and_then(|()| file.write_all(settings.as_bytes()))
                .map_err(&failed)?;
        }
        Ok(Self { folder, settings, _lock: file })
    }

    fn path(&self, scene: &str) -> PathBuf {
        self.folder.join(format!("{scene}.part"))
    }

    /// What the part of a scene holds, if it is whole and made of the very record.
    pub fn find(&self, scene: &str, sha256: &str) -> Option<Head> {
        let file = WindowsFile::open(&self.path(scene)).ok()?;
        let [record] = &file.head.scenes[..] else { return None };
        let is_it = record.id == scene && record.sha256 == sha256 && file.head.settings == self.settings;
        let is_whole = |number| file.payload(number).is_ok();
        (is_it && (0..file.head.places.len()).all(is_whole)).then_some(file.head)
    }

    /// Keeps what a scene gives; answers the part's head.
    pub fn put(&self, scene: &str, sha256: &str, cut: Pieces) -> Result<Head, PrepareError> {
        let place = |Piece { step, av, bytes }: &Piece| Place {
            scene: 0,
            step: *step,
            av: *av,
            offset: 0,
            length: bytes.len() as u32,
            checksum: crc32fast::hash(bytes),
        };
        let skipped =
            cut.skipped.iter().map(|(reason, windows)| Skipped { reason: (*reason).into(), windows: *windows });
        let (id, sha256, role) = (scene.to_owned(), sha256.to_owned(), Role::Training);
        let mut head = Head {
            settings: self.settings.clone(),
            scenes: vec![SceneRecord { id, sha256, role, skipped: skipped.collect() }],
            places: cut.pieces.iter().map(place).collect(),
        };
        head.lay_out();
        let path = self.path(scene);
        // Not synced: a part that a crash of the machine left in pieces is seen to be such, and made anew.
        whole(&path, false, |out| {
            out.write_all(&head.write())?;
            cut.pieces.iter().try_for_each(|piece| out.write_all(&piece.bytes))
        })?;
        Ok(head)
    }

    /// Joins the parts that have these heads, in their order, under the name `out`, with `settings`.
    pub fn join(&self, out: &Path, settings: String, heads: Vec<Head>) -> Result<Head, PrepareError> {
        let mut whole_head = Head { settings, scenes: Vec::new(), places: Vec::new() };
        for head in heads {
            let number = whole_head.scenes.len() as u32; // a part has one scene
            whole_head.scenes.extend(head.scenes);
            whole_head.places.extend(head.places.into_iter().map(|place| Place { scene: number, ..place }));
        }
        whole_head.lay_out();
        let mut broken = None;
        let written = whole(out, true, |file| {
            file.write_all(&whole_head.write())?;
            for scene in &whole_head.scenes {
                if let Err(error) = self.copy(scene, file)? {
                    broken = Some(error);
                    return Err(io::Error::other("a part has changed"));
                }
            }
            Ok(())
        });
        match broken {
            Some(error) => Err(error.into()),
            None => written.map(|()| whole_head),
        }
    }

    /// Copies the windows of a scene.
    fn copy(&self, scene: &SceneRecord, to: &mut impl Write) -> io::Result<Result<(), WindowsError>> {
        let part = match WindowsFile::open(&self.path(&scene.id)) {
            Ok(part) => part,
            Err(error) => return Ok(Err(error)),
        };
        for number in 0..part.head.places.len() {
            match part.payload(number) {
                Ok(bytes) => to.write_all(&bytes)?,
                Err(error) => return Ok(Err(error)),
            }
        }
        Ok(Ok(()))
    }

    /// Takes the folder away.
    pub fn remove(self) -> Result<(), PrepareError> {
        remove_parts(&self.folder)?;
        let settings = self.folder.join(SETTINGS);
        fs::remove_file(&settings).map_err(at(&settings))?;
        // Whatever else somebody has put there stays, and so does the folder.
        match fs::remove_dir(&self.folder) {
            Err(error) if error.kind() != io::ErrorKind::DirectoryNotEmpty => Err(at(&self.folder)(error)),
            _ => Ok(()),
        }
    }
}

/// Takes away the parts in a folder, and what a killed process left of some.
fn remove_parts(folder: &Path) -> Result<(), PrepareError> {
    for entry in fs::read_dir(folder).map_err(at(folder))? {
        let path = entry.map_err(at(folder))?.path();
        if path.extension().is_some_and(|extension| extension == "part" || extension == "partial") {
            fs::remove_file(&path).map_err(at(&path))?;
        }
    }
    Ok(())
}

/// A file that appears under its name when it is whole; `sync` makes it last.
fn whole(
    path: &Path,
    sync: bool,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), PrepareError> {
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    let partial = PathBuf::from(partial);
    let written = || -> io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 20, File::create(&partial)?);
        write(&mut out)?;
        let file = out.into_inner().map_err(io::IntoInnerError::into_error)?;
        if sync {
            file.sync_all()?;
        }
        fs::rename(&partial, path)?;
        if sync {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            File::open(folder)?.sync_all()?;
        }
        Ok(())
    };
    written().map_err(at(path))
}

fn at(path: &Path) -> impl Fn(io::Error) -> PrepareError {
    move |source| PrepareError::Write { path: path.into(), source }
}
