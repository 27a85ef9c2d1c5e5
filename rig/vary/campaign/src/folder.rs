//! The folder of a campaign: its plan, the result of every case once, and attempts that are under way.
//!
//! An attempt has a folder of its own, which is renamed to that of the case when the case has ended. So a case has a
//! result or none, whenever a process dies. An attempt whose process is gone is swept.

use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use masseter_scenario::Scenario;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};

use crate::campaign::Campaign;
use crate::case::{Case, CaseResult};

const PLAN: &str = "plan.json";
const CASES: &str = "cases";
const ATTEMPTS: &str = "attempts";
const LOCK: &str = "lock";
const RESULT: &str = "result.json";
const SCENARIO: &str = "scenario.toml";

/// Why the folder of a campaign cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// It is that of another campaign, which differs in this.
    #[error("{} belongs to another campaign: {}; choose another --out", .0.display(), .1)]
    OfAnother(PathBuf, &'static str),
    /// A process runs this campaign.
    #[error("another masseter runs the campaign in {}", .0.display())]
    InUse(PathBuf),
    /// It holds files, but no campaign.
    #[error("{} exists and is no folder of a campaign; choose another --out", .0.display())]
    NoCampaign(PathBuf),
    /// Its plan has been damaged, for this reason.
    #[error("{}: it is no plan: {}; choose another --out", .0.display(), .1)]
    DamagedPlan(PathBuf, serde_json::Error),
    /// A file in it has been damaged, for this reason.
    #[error("{}: it is no result: {}; remove its folder, and the rest goes on", .0.display(), .1)]
    Damaged(PathBuf, serde_json::Error),
    /// The system refuses an operation on a file or folder in it.
    #[error("{}: {}", .0.display(), .1)]
    System(PathBuf, io::Error),
}

/// A campaign on the disk.
#[derive(Debug)]
pub struct CampaignFolder {
    path: PathBuf,
    /// The right to run the campaign; given back when it is dropped or its process dies. None for a single case.
    _lock: Option<File>,
}

impl CampaignFolder {
    /// Makes the folder of a campaign, or goes on with the same campaign.
    ///
    /// # Errors
    /// [`FolderError`]: another campaign is there, or a process runs this one.
    pub fn begin(path: &Path, campaign: &Campaign) -> Result<Self, FolderError> {
        let folder = Self { path: path.to_owned(), _lock: None };
        if path.is_dir() && !folder.plan_path().exists() && fs::read_dir(path).is_ok_and(has_more_than_a_lock)
        {
            return Err(FolderError::NoCampaign(path.to_owned()));
        }
        for inner in [folder.cases_path(), folder.path.join(ATTEMPTS)] {
            fs::create_dir_all(&inner).map_err(system(&inner))?;
        }
        let folder = Self { _lock: Some(lock(path)?), ..folder };
        if folder.plan_path().exists() {
            let difference = folder.read_plan()?.difference_to(campaign);
            difference.map_or(Ok(()), |words| Err(FolderError::OfAnother(path.to_owned(), words)))?;
        } else {
            let plan = serde_json::to_string_pretty(campaign).expect("a campaign has a JSON form");
            let unfinished = folder.path.join(ATTEMPTS).join(PLAN);
            let written = write_through(&unfinished, &plan);
            let written = written.and_then(|()| fs::rename(&unfinished, folder.plan_path()));
            written.map_err(system(&folder.plan_path()))?;
        }
        folder.sweep()?;
        Ok(folder)
    }

    /// Opens the folder of a campaign that has begun, and reads its plan.
    ///
    /// # Errors
    /// [`FolderError`]: no campaign is there.
    pub fn open(path: &Path) -> Result<(Self, Campaign), FolderError> {
        let folder = Self { path: path.to_owned(), _lock: None };
        if !folder.plan_path().is_file() {
            return Err(FolderError::NoCampaign(path.to_owned()));
        }
        let campaign = folder.read_plan()?;
        Ok((folder, campaign))
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Another file of this name.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The result of a case; none of one that has not ended.
    ///
    /// # Errors
    /// [`FolderError::Damaged`] for a file that is no result.
    pub fn result_of(&self, case: &Case) -> Result<Option<CaseResult>, FolderError> {
        let path = self.cases_path().join(&case.id).join(RESULT);
        if path.is_file() { read_result(&path).map(Some) } else { Ok(None) }
    }

    /// Begins an attempt at a case.
    ///
    /// # Errors
    /// When its folder cannot be made.
    pub fn attempt(&self, case: &Case) -> Result<Attempt, FolderError> {
        let attempts = self.path.join(ATTEMPTS);
        let _no_sweep = self.hold_plan(File::lock_shared)?;
        let prefix = format!("{}.", case.id);
        let folder =
            tempfile::Builder::new().prefix(&prefix).tempdir_in(&attempts).map_err(system(&attempts))?;
        let lock = lock(folder.path())?;
        Ok(Attempt { folder, target: self.cases_path().join(&case.id), _lock: lock })
    }

    /// Removes the attempts of processes that are gone.
    fn sweep(&self) -> Result<(), FolderError> {
        let attempts = self.path.join(ATTEMPTS);
        let _no_beginning = self.hold_plan(File::lock)?;
        for entry in fs::read_dir(&attempts).map_err(system(&attempts))? {
            let path = entry.map_err(system(&attempts))?.path();
            // No attempt begins now, so a folder without a lock belongs to a process that died before it had one.
            let is_alive = File::open(path.join(LOCK)).is_ok_and(|file| file.try_lock().is_err());
            if !is_alive {
                let _ = fs::remove_dir_all(&path);
            }
        }
        Ok(())
    }

    /// Keeps the sweep and the beginning of attempts apart while the file lives: attempts share it, the sweep has it
    /// alone.
    fn hold_plan(&self, lock: fn(&File) -> io::Result<()>) -> Result<File, FolderError> {
        let path = self.plan_path();
        let plan = File::options().append(true).open(&path).map_err(system(&path))?;
        lock(&plan).map_err(system(&path))?;
        Ok(plan)
    }

    fn read_plan(&self) -> Result<Campaign, FolderError> {
        read_json(&self.plan_path(), FolderError::DamagedPlan)
    }

    fn plan_path(&self) -> PathBuf {
        self.file(PLAN)
    }

    fn cases_path(&self) -> PathBuf {
        self.file(CASES)
    }
}

/// A case that is being run.
#[derive(Debug)]
pub struct Attempt {
    folder: tempfile::TempDir,
    target: PathBuf,
    _lock: File,
}

impl Attempt {
    /// Keeps the result, and the scenario of a case that did not pass. If another attempt was faster, its result stays.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn keep_result(self, result: &CaseResult, scenario: Option<&Scenario>) -> Result<(), FolderError> {
        let path = self.folder.path();
        if let Some(scenario) = scenario.filter(|_| !result.has_passed()) {
            let kept = path.join(SCENARIO);
            fs::write(&kept, scenario.to_toml()).map_err(system(&kept))?;
        }
        let kept = path.join(RESULT);
        let text = serde_json::to_string(result).expect("a result has a JSON form");
        write_through(&kept, &text).map_err(system(&kept))?;
        if self.target.exists() && read_result(&self.target.join(RESULT)).is_err() {
            // What a power cut or a user left there is no result.
            fs::remove_dir_all(&self.target).map_err(system(&self.target))?;
        }
        let renamed = fs::rename(path, &self.target);
        let is_late = |kind| matches!(kind, ErrorKind::DirectoryNotEmpty | ErrorKind::AlreadyExists);
        if let Err(error) = renamed {
            return if is_late(error.kind()) { Ok(()) } else { Err(error).map_err(system(&self.target)) };
        }
        let _ = fs::remove_file(self.target.join(LOCK));
        Ok(())
    }
}

/// Writes a file so that it survives a power cut.
fn write_through(path: &Path, text: &str) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()
}

fn has_more_than_a_lock(entries: fs::ReadDir) -> bool {
    let ours = [LOCK, CASES, ATTEMPTS];
    entries.flatten().any(|entry| !ours.iter().any(|name| entry.file_name() == *name))
}

/// The locked file of a folder; refused if another process has locked it.
fn lock(folder: &Path) -> Result<File, FolderError> {
    let path = folder.join(LOCK);
    let file = File::options().create(true).append(true).open(&path).map_err(system(&path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(FolderError::InUse(folder.to_owned())),
        Err(TryLockError::Error(error)) => Err(system(&path)(error)),
    }
}

fn read_result(path: &Path) -> Result<CaseResult, FolderError> {
    read_json(path, FolderError::Damaged)
}

fn read_json<T: serde::de::DeserializeOwned>(
    path: &Path,
    damaged: impl FnOnce(PathBuf, serde_json::Error) -> FolderError,
) -> Result<T, FolderError> {
    let text = read_text(path, MOST_KEPT_BYTES).map_err(system(path))?;
    serde_json::from_str(&text).map_err(|error| damaged(path.to_owned(), error))
}

fn system(path: &Path) -> impl FnOnce(io::Error) -> FolderError {
    let path = path.to_owned();
    |error| FolderError::System(path, error)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign(text: &str) -> Campaign {
        Campaign {
            file: toml::from_str(text).unwrap(),
            controller: "motion".to_owned(),
            program: "program".to_owned(),
            folder: "/".into(),
            base: Scenario::default().to_toml(),
        }
    }

    fn two() -> Campaign {
        campaign("[[factor]]\nkey = 'rate_hz'\nvalues = [500, 1000]")
    }

    fn case(number: usize) -> Case {
        two().case(&two().points(), number)
    }

    /// The result of every case that has ended.
    fn results(folder: &CampaignFolder) -> Result<Vec<CaseResult>, FolderError> {
        let cases =
            fs::read_dir(folder.cases_path()).unwrap().map(|entry| entry.unwrap().path().join(RESULT));
        cases.filter(|result| result.is_file()).map(|result| read_result(&result)).collect()
    }

    fn failed(case: &Case) -> CaseResult {
        CaseResult::without_run(case, "FAIL", 1, "failed: tracking".to_owned())
    }

    #[test]
    fn a_campaign_goes_on_where_it_was_and_keeps_each_result_once() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("campaign");
        let folder = CampaignFolder::begin(&path, &two()).unwrap();
        let first = case(0);
        folder.attempt(&first).unwrap().keep_result(&failed(&first), first.scenario.as_ref().ok()).unwrap();
        // The second attempt comes too late, and does no harm.
        let late = CaseResult { word: "PASS".to_owned(), exit_code: 0, ..failed(&first) };
        folder.attempt(&first).unwrap().keep_result(&late, first.scenario.as_ref().ok()).unwrap();
        drop(folder);

        let folder = CampaignFolder::begin(&path, &two()).unwrap();
        assert_eq!(folder.result_of(&case(1)).unwrap(), None);
        assert_eq!(results(&folder).unwrap(), [failed(&first)]);
        assert!(path.join(CASES).join(&first.id).join(SCENARIO).is_file());
        assert_eq!(fs::read_dir(path.join(ATTEMPTS)).unwrap().count(), 0);
    }

    #[test]
    fn an_attempt_of_a_dead_process_is_swept_and_a_live_one_stays() {
        let parent = tempfile::tempdir().unwrap();
        let folder = CampaignFolder::begin(parent.path(), &two()).unwrap();
        let live = folder.attempt(&case(0)).unwrap();
        let attempts = parent.path().join(ATTEMPTS);
        let [dead, dead_before_its_lock] = ["00001-dead.x", "00002-dead.y"].map(|name| attempts.join(name));
        fs::create_dir(&dead).unwrap();
        fs::write(dead.join(LOCK), "").unwrap();
        fs::create_dir(&dead_before_its_lock).unwrap();
        drop(folder);
        CampaignFolder::begin(parent.path(), &two()).unwrap();
        assert!(!dead.exists() && !dead_before_its_lock.exists() && live.folder.path().exists());
    }

    #[test]
    fn the_folder_of_another_campaign_is_refused_with_the_difference() {
        let parent = tempfile::tempdir().unwrap();
        let folder = CampaignFolder::begin(parent.path(), &two()).unwrap();
        let refusal =
            |campaign: &Campaign| CampaignFolder::begin(parent.path(), campaign).unwrap_err().to_string();
        assert!(refusal(&two()).contains("another masseter runs"));
        drop(folder);
        let other = campaign("[[factor]]\nkey = 'rate_hz'\nvalues = [500, 1000, 2000]");
        assert!(refusal(&other).contains("the file of the campaign has changed"), "{}", refusal(&other));
        let rebuilt = Campaign { program: "other".to_owned(), ..two() };
        assert!(refusal(&rebuilt).contains("another build of masseter"), "{}", refusal(&rebuilt));
    }

    #[test]
    fn a_folder_with_other_files_is_left_alone() {
        let parent = tempfile::tempdir().unwrap();
        fs::write(parent.path().join("thesis.tex"), "").unwrap();
        let refusal = CampaignFolder::begin(parent.path(), &two()).unwrap_err().to_string();
        assert!(refusal.contains("is no folder of a campaign"), "{refusal}");
        assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_result_takes_the_place_of_what_is_none() {
        let parent = tempfile::tempdir().unwrap();
        let folder = CampaignFolder::begin(parent.path(), &two()).unwrap();
        let left = parent.path().join(CASES).join(case(0).id);
        fs::create_dir(&left).unwrap();
        fs::write(left.join(SCENARIO), "").unwrap();
        folder.attempt(&case(0)).unwrap().keep_result(&failed(&case(0)), None).unwrap();
        assert_eq!(results(&folder).unwrap(), [failed(&case(0))]);
    }

    #[test]
    fn a_file_without_an_end_is_refused_at_once() {
        let parent = tempfile::tempdir().unwrap();
        let folder = CampaignFolder::begin(parent.path(), &two()).unwrap();
        let endless = |path: &Path| std::os::unix::fs::symlink("/dev/zero", path).unwrap();
        let kept = parent.path().join(CASES).join(case(0).id);
        fs::create_dir(&kept).unwrap();
        endless(&kept.join(RESULT));
        assert!(read_result(&kept.join(RESULT)).unwrap_err().to_string().contains("no regular file"));
        fs::remove_file(folder.plan_path()).unwrap();
        endless(&folder.plan_path());
        assert!(folder.read_plan().unwrap_err().to_string().contains("no regular file"));
    }

    #[test]
    fn a_damaged_result_is_named() {
        let parent = tempfile::tempdir().unwrap();
        let folder = CampaignFolder::begin(parent.path(), &two()).unwrap();
        let kept = parent.path().join(CASES).join(case(0).id);
        fs::create_dir(&kept).unwrap();
        fs::write(kept.join(RESULT), "{").unwrap();
        let refusal = results(&folder).unwrap_err().to_string();
        assert!(refusal.contains("remove its folder, and the rest goes on"), "{refusal}");
        fs::write(folder.plan_path(), "{").unwrap();
        let refusal = folder.read_plan().unwrap_err().to_string();
        // Its folder has the results of all other cases.
        assert!(refusal.contains("choose another --out") && !refusal.contains("remove"), "{refusal}");
    }
}
