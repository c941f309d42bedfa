#include "stages/input/take_input.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/join.h"
#include "dataset/footage/frames.h"
#include "dataset/session/timeline_source.h"
#include "stages/input/calib_read.h"

namespace mvstudio::stages {
namespace {

using dataset::CameraFootage;

void AddFootage(const std::string& option, const std::vector<NamedPath>& footage, TakeInput* input, InputNotes* notes) {
  for (const NamedPath& named : footage) {
    const auto& [camera, path] = named;
    const std::string word = option + " " + ToString(named);
    const bool twice = std::any_of(input->footage.begin(), input->footage.end(),
                                   [&name = camera](const CameraFootage& f) { return f.camera == name; });
    const std::string why = dataset::WhyNotAName(camera);
    if (!why.empty()) throw UsageError(word + ": a camera's name becomes a file name, and this one " + why);
    if (twice) throw UsageError(word + ": camera " + camera + " was given footage twice");
    input->footage.push_back({camera, path, ""});
    notes->inputs.push_back(path);
  }
}

void WarnIfOlder(const dataset::Session& session, const dataset::SessionTake& take, const std::string& timeline,
                 bool allow_outside, InputNotes* notes) {
  std::error_code error;
  const auto written = std::filesystem::last_write_time(timeline, error);
  for (const dataset::SessionFootage& f : take.footage) {
    const auto filmed = std::filesystem::last_write_time(dataset::ResolveInSession(session, f.path, allow_outside), error);
    if (error || filmed <= written) continue;
    notes->warnings.push_back({"SES-TIMELINE", timeline + " is older than the footage of camera " + f.camera,
                               "run mvstudio session timeline again if the footage changed"});
    return;
  }
}

void ReadSessionTake(const TakeArguments& arguments, TakeInput* input, InputNotes* notes) {
  input->session = dataset::ReadSession(arguments.session, arguments.allow_outside);
  const dataset::Session& session = *input->session;
  for (const std::string& warning : session.warnings) {
    notes->warnings.push_back({"SES-KEY", warning, "see docs/formats.md for the keys of mvstudio.toml"});
  }
  const dataset::SessionTake& take = dataset::TakeOf(session, arguments.take);
  if (take.footage.empty()) throw UsageError("take " + take.name + " of " + session.folder + " has no footage");
  input->take = take.name;
  input->fps_hz = take.fps_hz.value_or(session.fps_hz.value_or(0));
  input->calibration = dataset::CalibrationOf(session, arguments.allow_outside);
  const auto timeline =
      arguments.with_timeline ? TimelineOf(session, take, arguments.allow_outside, arguments.make_timeline, notes) : nullptr;
  for (const dataset::SessionFootage& f : take.footage) {
    CameraFootage footage{f.camera, dataset::ResolveInSession(session, f.path, arguments.allow_outside), ""};
    if (!f.plate.empty()) footage.plate = dataset::ResolveInSession(session, f.plate, arguments.allow_outside);
    footage.timeline = timeline;
    notes->inputs.push_back(footage.path);
    input->footage.push_back(std::move(footage));
  }
}

/// Size or digest of a video; of images, their paths. Empty where nothing can be said: what cannot be read its reader names.
std::string FilesOf(const std::string& path, bool digest) {
  try {
    const dataset::FootageFiles files = dataset::ListFootage(path);
    if (files.is_video && files.paths.size() == 1) {
      constexpr uintmax_t kLeastBytes = 1024;  // of any video
      const uintmax_t size = std::filesystem::file_size(files.paths[0]);
      return size < kLeastBytes ? "" : digest ? Sha256File(files.paths[0]) : std::to_string(size);
    }
    std::string names;
    for (const std::string& file : files.paths) names += std::filesystem::weakly_canonical(file).string() + "\n";
    return names;
  } catch (const Error&) {
    return "";
  } catch (const std::filesystem::filesystem_error&) {
    return "";
  }
}

}  // namespace

void RefuseSameFootage(const std::vector<NamedPath>& footage, bool of_session) {
  std::map<std::string, std::vector<const NamedPath*>> alike;
  for (const NamedPath& each : footage) alike[FilesOf(each.path, false)].push_back(&each);
  for (const auto& [size, list] : alike) {
    if (size.empty() || list.size() < 2) continue;
    std::map<std::string, const NamedPath*> first;
    for (const NamedPath* each : list) {
      const auto [at, is_new] = first.emplace(FilesOf(each->path, true), each);
      if (is_new) continue;
      throw FormatError(each->path, "",
                        "is the same recording as " + at->second->path + ": cameras " + at->second->name + " and " +
                            each->name + " cannot have filmed the same; copy the right file, or leave one of the two out" +
                            (of_session ? " of the take in mvstudio.toml" : ""));
    }
  }
}

std::shared_ptr<const dataset::Timeline> TimelineOf(const dataset::Session& session, const dataset::SessionTake& take,
                                                    bool allow_outside, bool make, InputNotes* notes) {
  const std::string path = dataset::TimelinePath(session, take.name);
  if (std::filesystem::exists(path)) {
    notes->inputs.push_back(path);
    WarnIfOlder(session, take, path, allow_outside, notes);
    return std::make_shared<dataset::Timeline>(dataset::ReadTimeline(path));
  }
  const bool related = !take.timestamps.empty() || !dataset::SyncPathOf(session, take, allow_outside).empty();
  if (!make || !related) return nullptr;
  dataset::TakeTimelineOptions options;
  options.allow_outside = allow_outside;
  dataset::TakeTimeline made = dataset::BuildTakeTimeline(session, take, options);
  for (const std::string& note : made.notes) {
    notes->warnings.push_back({"SES-TIMELINE", note, "see mvstudio session timeline"});
  }
  return std::make_shared<dataset::Timeline>(std::move(made.timeline));
}

bool NameUncalibrated(const std::string& calibration, const std::vector<std::string>& cameras, std::vector<std::string>* kept,
                      InputNotes* notes) {
  const geometry::Rig rig = ReadCalibrationFiles({calibration}, {}).rig;
  std::vector<std::string> out;
  for (const std::string& camera : cameras) (rig.Find(camera) >= 0 ? *kept : out).push_back(camera);
  if (out.empty()) return false;
  if (kept->size() < 2) {
    throw FormatError(calibration, "cameras",
                      "has no " + Join(out, ", ") + ", so fewer than two cameras are left; it has " +
                          Join(geometry::CameraNames(rig), ", ") + ": calibrate them, or give the session its names");
  }
  notes->warnings.push_back({"CAL-LEFTOUT", calibration + " has no calibration of " + Join(out, ", ") + ": left out here",
                             "film the board with it and calibrate again; the other cameras are used"});
  notes->partial = true;
  return true;
}

void LeaveOutUncalibrated(const std::string& calibration, TakeInput* take, InputNotes* notes) {
  if (!take->session || calibration.empty()) return;
  std::vector<std::string> cameras, kept;
  for (const CameraFootage& footage : take->footage) cameras.push_back(footage.camera);
  if (!NameUncalibrated(calibration, cameras, &kept, notes)) return;
  const auto is_out = [&](const CameraFootage& f) { return std::find(kept.begin(), kept.end(), f.camera) == kept.end(); };
  take->footage.erase(std::remove_if(take->footage.begin(), take->footage.end(), is_out), take->footage.end());
}

void RefuseWithoutCalibration(const std::string& session) {
  if (session.empty()) throw UsageError("option 'calib' is needed: the calibration of these cameras");
  throw UsageError(session + " has no calibration: run mvstudio calibrate option 'session' " + session +
                   ", or give option 'calib'");
}

std::string TakeInput::Folder(const std::string& kind, const std::string& camera) const {
  return session ? dataset::TakeFolder(*session, kind, take, camera) : "";
}

std::vector<std::string> TakeInput::Paths() const {
  std::vector<std::string> paths;
  for (const dataset::CameraFootage& camera : footage) paths.insert(paths.end(), {camera.path, camera.plate});
  return paths;
}

TakeInput ReadTakeInput(const TakeArguments& arguments, InputNotes* notes) {
  TakeInput input;
  const bool named = !arguments.video.empty() || !arguments.images.empty();
  if (!arguments.session.empty() && named)
    throw UsageError("give either option 'session', or option 'video' and option 'images'");
  if (arguments.session.empty() && !arguments.take.empty()) throw UsageError("option 'take' needs option 'session'");
  if (!arguments.session.empty()) ReadSessionTake(arguments, &input, notes);
  AddFootage("option 'video'", arguments.video, &input, notes);
  AddFootage("option 'images'", arguments.images, &input, notes);
  for (const NamedPath& plate : arguments.plate) {
    const auto found = std::find_if(input.footage.begin(), input.footage.end(),
                                    [&](const CameraFootage& f) { return f.camera == plate.name; });
    if (found == input.footage.end())
      throw UsageError("option 'plate' " + ToString(plate) + ": camera " + plate.name + " has no footage");
    found->plate = plate.path;
    notes->inputs.push_back(plate.path);
  }
  std::vector<NamedPath> named_footage;
  for (const CameraFootage& footage : input.footage) named_footage.push_back({footage.camera, footage.path});
  RefuseSameFootage(named_footage, input.session.has_value());
  return input;
}

}  // namespace mvstudio::stages
