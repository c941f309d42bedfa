#include "dataset/import/panoptic_import.h"

#include <algorithm>
#include <filesystem>
#include <mutex>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "dataset/import/import_steps.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/panoptic_json.h"
#include "dataset/verify/verify_steps.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using internal::Findings;
using internal::ImportedFootage;
using internal::ImportJob;

constexpr double kHdFps = 30000.0 / 1001, kVgaFps = 25;

/// Copies the files that can be read.
int KeepLandmarks(ImportJob* job, const PanopticFrames& frames, const char* code) {
  int kept = 0;
  for (const auto& [frame, path] : frames.files) {
    if (!job->range.Has(frame)) continue;
    try {
      const std::string text = internal::ReadTextFile(path, internal::kMaxLandmarkBytes);
      ParsePanopticLandmarks(text, path);
      const fs::path to = fs::path(job->work) / "panoptic" / fs::path(frames.folder).filename();
      if (kept++ == 0) MakeFolder(to.string());
      WriteFile((to / fs::path(path).filename()).string(), text);
    } catch (const FormatError& error) {
      job->findings.Error(code, path, internal::WithoutPath(error));
    }
  }
  return kept;
}

void KeepFile(const ImportJob& job, const std::string& path, int64_t max_bytes) {
  if (path.empty()) return;
  WriteFileAtomic(job.work + "/panoptic/" + fs::path(path).filename().string(), internal::ReadTextFile(path, max_bytes));
}

/// The clock of a camera; null when nothing is known of it.
const PanopticClock* ClockOf(const std::map<std::string, PanopticClock>& clocks, const std::string& camera) {
  const PanopticKind kind = KindOfCamera(camera);
  const auto found = clocks.find(kind == PanopticKind::kKinect ? camera : ToString(kind));
  return found == clocks.end() ? nullptr : &found->second;
}

/// True when each of the frames has a time.
bool Covers(const PanopticClock* clock, const std::vector<int>& frames) {
  return clock && std::all_of(frames.begin(), frames.end(), [&](int f) { return clock->TimeMs(f).has_value(); });
}

std::string TimeText(double seconds) { return Format("%.6f", seconds); }

/// Frames of each camera on the universal clock.
void WriteTimes(const std::vector<const ImportedFootage*>& footage, const std::map<std::string, PanopticClock>& clocks,
                const std::string& path) {
  std::string text = "camera,frame,time_s\n";
  for (const ImportedFootage* f : footage) {
    const PanopticClock* clock = ClockOf(clocks, f->camera);
    for (const int frame : f->frames)
      text += f->camera + "," + std::to_string(frame) + "," + TimeText(*clock->TimeMs(frame) / 1000) + "\n";
  }
  WriteFileAtomic(path, text);
}

void WriteHdTimes(const PanopticClock& clock, const std::map<int, double>& scene_times, const std::string& path) {
  std::string text = "frame,univ_time_ms,source\n";
  for (const auto& [frame, time] : clock.known_ms) {
    text +=
        std::to_string(frame) + "," + internal::StreamNumberText(time) + (scene_times.count(frame) ? ",joints\n" : ",table\n");
  }
  WriteFileAtomic(path, text);
}

/// Groups the cameras into takes: those on the universal clock with the HD cameras, the others by kind.
class TakeMaker {
 public:
  TakeMaker(ImportJob* job, const std::map<std::string, PanopticClock>& clocks) : job_(job), clocks_(clocks) {}

  std::string TakeOfCamera(const std::string& camera) const {
    const PanopticKind kind = KindOfCamera(camera);
    if (kind == PanopticKind::kHd || (clocks_.count("hd") && ClockOf(clocks_, camera))) return job_->take;
    return job_->take + "-" + ToString(kind);
  }

  std::vector<SessionTake> Make(const std::vector<ImportedFootage>& footage) const {
    std::vector<SessionTake> takes;
    for (const ImportedFootage& f : footage) {
      if (f.path.empty()) continue;
      const std::string name = TakeOfCamera(f.camera);
      auto at = std::find_if(takes.begin(), takes.end(), [&](const SessionTake& t) { return t.name == name; });
      if (at == takes.end()) {
        at = takes.emplace(takes.end());
        at->name = name;
        at->fps_hz = KindOfCamera(f.camera) == PanopticKind::kVga ? kVgaFps : kHdFps;
      }
      at->footage.push_back({f.camera, f.path, ""});
    }
    for (SessionTake& take : takes) AddTimes(footage, &take);
    return takes;
  }

 private:
  void AddTimes(const std::vector<ImportedFootage>& footage, SessionTake* take) const {
    std::vector<const ImportedFootage*> members;
    bool covered = true;
    for (const ImportedFootage& f : footage) {
      if (f.path.empty() || TakeOfCamera(f.camera) != take->name) continue;
      members.push_back(&f);
      covered = covered && Covers(ClockOf(clocks_, f.camera), f.frames);
    }
    if (covered) {
      take->timestamps = "sync/" + take->name + ".times.csv";
      WriteTimes(members, clocks_, job_->work + "/" + take->timestamps);
      if (const PanopticClock* clock = ClockOf(clocks_, members[0]->camera); clock->is_line)
        take->fps_hz = 1000 / clock->period_ms;
    } else if (take->name != job_->take) {
      job_->findings.Warning("DAT-TIME", job_->sequence.root,
                             "nothing relates the clock of take " + take->name +
                                 " to the HD cameras': it needs vgaPose3d or the sync tables of the sequence");
    }
  }

  ImportJob* job_;
  const std::map<std::string, PanopticClock>& clocks_;
};

void ChooseCameras(ImportJob* job, PanopticImportReport* report) {
  std::vector<std::string> names, with_footage;
  for (const auto& camera : job->rig.cameras) {
    int panel = 0, node = 0;
    if (!ParsePanopticName(camera.camera.name, &panel, &node)) continue;
    names.push_back(camera.camera.name);
    if (job->sequence.footage.count(names.back())) with_footage.push_back(names.back());
  }
  std::vector<std::string> chosen = with_footage.empty() ? names : with_footage;
  if (!job->options.cameras.empty()) chosen = SelectPanopticCameras(names, job->options.cameras);
  auto& cameras = job->rig.cameras;
  cameras.erase(std::remove_if(cameras.begin(), cameras.end(),
                               [&](const geometry::RigCamera& c) {
                                 return std::find(chosen.begin(), chosen.end(), c.camera.name) == chosen.end();
                               }),
                cameras.end());
  // The first one counts the time steps: an HD camera, whose frames also number the joints.
  std::stable_sort(cameras.begin(), cameras.end(), [](const geometry::RigCamera& a, const geometry::RigCamera& b) {
    return KindOfCamera(a.camera.name) < KindOfCamera(b.camera.name);
  });
  for (const std::string& name : chosen) {
    if (!with_footage.empty() && std::find(with_footage.begin(), with_footage.end(), name) == with_footage.end())
      job->findings.Error("DAT-IMAGE", job->sequence.root, "holds neither images nor a video of camera " + name);
  }
  for (const auto& [name, footage] : job->sequence.footage) {
    if (std::find(names.begin(), names.end(), name) == names.end())
      job->findings.Error("DAT-NAME", footage.path, "the calibration has no camera " + name + " that can be read");
  }
  report->cameras = static_cast<int>(cameras.size());
}

std::vector<ImportedFootage> ImportAllFootage(ImportJob* job, const TakeMaker& takes) {
  std::vector<ImportedFootage> footage(job->rig.cameras.size());
  std::vector<Findings> findings(footage.size());
  ProgressStage stage(job->run, "footage", static_cast<int64_t>(footage.size()));
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(footage.size()), job->run.num_threads, [&](int64_t i) {
    const auto k = static_cast<size_t>(i);
    const geometry::RigCamera& camera = job->rig.cameras[k];
    footage[k] = internal::ImportFootage(*job, camera, takes.TakeOfCamera(camera.camera.name), &findings[k]);
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
  for (const Findings& f : findings) job->findings.Append(f);
  return footage;
}

void WriteSessionFile(const ImportJob& job, std::vector<SessionTake> takes) {
  Session session;
  session.folder = job.work;
  session.units = "m";
  session.source = "CMU Panoptic sequence " + job.sequence.name;
  session.calibration = "calib/calibration.json";
  for (const auto& c : job.rig.cameras) {
    SessionCamera camera;
    camera.name = c.camera.name;
    camera.width_px = c.camera.width_px;
    camera.height_px = c.camera.height_px;
    session.cameras.push_back(camera);
  }
  session.takes = std::move(takes);
  WriteSession(session);
}

constexpr ChoiceWords<ImportImages, 3> kImportImages = {
    {{ImportImages::kLink, "link"}, {ImportImages::kCopy, "copy"}, {ImportImages::kDecode, "decode"}}};

void CheckOptions(const std::string& root, const PanopticImportOptions& options) {
  if (options.quality < 1 || options.quality > 100) throw UsageError("option 'quality' must be 1 to 100");
  if (!options.take.empty() && Slug(options.take) != options.take)
    throw UsageError("option 'take' " + internal::Quoted(options.take) + " cannot name a folder; use letters, digits, _ and -");
  RequireFolder(root, "; of an archive give what it holds, unpacked");
}

void RefuseLinks(const PanopticSequence& sequence, const PanopticImportOptions& options) {
  if (options.follow_links || sequence.links_out.empty()) return;
  const auto& [path, target] = sequence.links_out.front();
  throw FormatError(
      path, "",
      "is a symbolic link out of the sequence, to " + internal::Quoted(target) +
          (sequence.links_out.size() > 1 ? " (and " + std::to_string(sequence.links_out.size() - 1) + " more)" : "") +
          "; option 'follow-links' reads through it");
}

/// The sequence and the cameras chosen of it.
ImportJob MakeJob(const std::string& root, const PanopticImportOptions& options, const RunContext& run,
                  PanopticImportReport* report) {
  ImportJob job{options, run, {}, {}, "", "", internal::ParseFrameRange(options.frames), {}};
  job.sequence = ScanPanopticSequence(root, options.follow_links);
  RefuseLinks(job.sequence, options);
  report->sequence = job.sequence.name;
  job.take = options.take.empty() ? Slug(job.sequence.name) : options.take;
  job.rig = internal::VerifyCalibration(job.sequence.calibration, &job.findings);
  if (job.rig.cameras.empty()) {
    throw FormatError(job.sequence.calibration, "cameras",
                      "none can be read; " + (job.findings.list().empty() ? "" : job.findings.list()[0].text));
  }
  ChooseCameras(&job, report);
  const bool joints = !job.sequence.hd_scenes.files.empty() || !job.sequence.vga_scenes.files.empty();
  if (!joints) {
    const std::string why = "holds no joints (hdPose3d_stage1_coco19/body3DScene_*.json)" + NotUnpacked(root);
    if (job.sequence.footage.empty()) throw FormatError(root, "", why + "; and neither images nor videos: nothing to import");
    job.findings.Warning("DAT-POSE", root, why);
  }
  for (const auto& [path, why] : job.sequence.strange) job.findings.Warning("DAT-NAME", path, why);
  return job;
}

/// Whether the chosen cameras have footage, and none of it is of an HD camera.
bool HasFootageWithoutHd(const ImportJob& job) {
  bool any = false;
  for (const auto& c : job.rig.cameras) {
    const bool there = job.sequence.footage.count(c.camera.name) > 0;
    if (there && KindOfCamera(c.camera.name) == PanopticKind::kHd) return false;
    any = any || there;
  }
  return any;
}

/// Joints numbered by VGA frames, for takes that number their time steps by them.
void ImportVgaJoints(ImportJob* job, const TakeMaker& takes, bool without_hd) {
  for (const auto& c : job->rig.cameras) {
    const std::string take = takes.TakeOfCamera(c.camera.name);
    const bool filmed = KindOfCamera(c.camera.name) == PanopticKind::kVga && job->sequence.footage.count(c.camera.name);
    if (!filmed || (take == job->take && !without_hd)) continue;
    PanopticImportReport ignored;
    if (!job->sequence.vga_scenes.files.empty()) internal::ImportJoints(job, job->sequence.vga_scenes, take, &ignored);
    return;
  }
}

/// Times of the HD frames whose joints were imported. A folder of joints that gives none is an error.
std::map<int, double> ImportHdJoints(ImportJob* job, bool without_hd, PanopticImportReport* report) {
  const PanopticFrames& scenes = job->sequence.hd_scenes;
  if (scenes.files.empty()) return {};
  const std::string take = job->take + (without_hd ? "-hd" : "");
  std::map<int, double> times = internal::ImportJoints(job, scenes, take, report);
  if (without_hd) {
    job->findings.Warning("DAT-POSE", scenes.folder,
                          "no HD camera has footage: joints counted by HD frames are in pose3d/" + take +
                              (job->sequence.vga_scenes.files.empty() ? "" : ", those by VGA frames with the take"));
  }
  if (report->frames > 0) return times;
  std::string why = "no file gives joints" + (job->options.frames.empty() ? "" : " in option 'frames' " + job->options.frames);
  if (!job->findings.list().empty()) why += "; " + job->findings.list().back().path + ": " + job->findings.list().back().text;
  throw FormatError(scenes.folder, "", why);
}

}  // namespace

namespace internal {

FrameRange ParseFrameRange(const std::string& text) {
  FrameRange range;
  if (text.empty()) return range;
  char end = 0;
  const int count = std::sscanf(text.c_str(), "%8d-%8d%c", &range.first, &range.last, &end);
  if (count == 1 && text.find_first_not_of("0123456789") == std::string::npos)
    range.last = range.first;
  else if (count != 2 || text.find_first_not_of("0123456789-") != std::string::npos || range.first > range.last)
    throw UsageError("option 'frames' " + Quoted(text) + " is not of the form A-B");
  return range;
}

}  // namespace internal

std::string_view ToString(ImportImages images) { return WordOf(kImportImages, images); }

void FromString(const std::string& text, ImportImages* images) {
  *images = KnownChoice(kImportImages, text, "option 'pictures' is link, copy or decode, not " + internal::Quoted(text));
}

PanopticImportReport ImportPanoptic(const std::string& root, const std::string& session_folder,
                                    const PanopticImportOptions& options, const RunContext& run) {
  CheckOptions(root, options);
  PanopticImportReport report;
  ImportJob job = MakeJob(root, options, run, &report);
  AtomicFolder folder(session_folder, options.overwrite, {root});
  job.work = folder.work_path();
  const bool without_hd = HasFootageWithoutHd(job);
  const std::map<int, double> scene_times = ImportHdJoints(&job, without_hd, &report);
  report.faces = KeepLandmarks(&job, job.sequence.faces, "DAT-FACE");
  report.hands = KeepLandmarks(&job, job.sequence.hands, "DAT-HAND");
  const auto clocks = internal::ImportClocks(&job, scene_times);
  const TakeMaker takes(&job, clocks);
  ImportVgaJoints(&job, takes, without_hd);
  const std::vector<ImportedFootage> footage = ImportAllFootage(&job, takes);
  for (const ImportedFootage& f : footage) report.images += f.images, report.cameras_with_footage += !f.path.empty();
  std::vector<SessionTake> session_takes = takes.Make(footage);
  for (const SessionTake& take : session_takes) report.takes.push_back(take.name);
  if (const auto hd = clocks.find("hd"); hd != clocks.end()) {
    report.worst_clock_ms = hd->second.worst_ms;
    WriteHdTimes(hd->second, scene_times, job.work + "/panoptic/hd_times.csv");
  }
  geometry::WriteRig(job.rig, job.work + "/calib/calibration.json");
  KeepFile(job, job.sequence.calibration, internal::kMaxCalibrationBytes);
  KeepFile(job, job.sequence.sync, internal::kMaxSyncBytes);
  KeepFile(job, job.sequence.kinect_sync, internal::kMaxSyncBytes);
  if (options.images == ImportImages::kLink && !session_takes.empty()) {
    job.findings.Warning(
        "DAT-OUTSIDE", session_folder,
        "its footage is symbolic links to " + root +
            ": commands on this session need option 'allow-outside', or `mvstudio session trust` once; option 'pictures' "
            "copy makes it whole");
  }
  WriteSessionFile(job, std::move(session_takes));
  folder.Commit();
  report.findings = job.findings.list();
  return report;
}

}  // namespace mvstudio::dataset
