#include "stages/error_budget/read.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>

#include "core/error.h"
#include "dataset/pose/markers.h"
#include "dataset/pose/pose3d_compare.h"
#include "dataset/session/timeline_source.h"
#include "dataset/time/sync_file.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/skeleton/skeleton_text.h"
#include "stages/input/calib_read.h"
#include "stages/input/pose3d_input.h"
#include "stages/input/take_frames.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

/// What the session says in place of options that were not given, its truth included.
std::optional<FoundTake> FillFromStudio(ErrorBudgetOptions* o, InputNotes* notes) {
  std::optional<FoundTake> found = FindTake(o->session, notes);
  if (!found) return found;
  const bool own = !o->pose.pose2d.empty();
  FillPoses(*found, o->session, &o->pose);
  if (!own) LeaveOutUncalibrated(&o->pose, notes);
  const auto fill = [](std::string* option, const std::string& path) {
    if (option->empty() && !path.empty() && fs::exists(path)) *option = path;
  };
  fill(&o->sync, dataset::SyncPathOf(found->session, found->take, o->session.allow_outside));
  const fs::path truth = fs::path(o->session.session) / "truth";
  fill(&o->truth, (truth / "pose3d").string());
  fill(&o->truth_calib, (truth / "calibration.json").string());
  fill(&o->truth_sync, (truth / "sync.json").string());
  if (o->out.empty()) o->out = dataset::TakeFolder(found->session, "error_budget", found->take.name);
  return found;
}

/// The cameras of the rig that have 2D joints.
geometry::Rig RigWithTracks(const PoseInput& input) {
  std::vector<size_t> kept;
  for (size_t c = 0; c < input.rig.cameras.size(); ++c) {
    const auto& name = input.rig.cameras[c].camera.name;
    if (std::any_of(input.tracks.begin(), input.tracks.end(), [&](const auto& track) { return track.camera == name; }))
      kept.push_back(c);
  }
  return kept.size() == input.rig.cameras.size() ? input.rig : SubsetOf(input.rig, kept);
}

void ReadClocks(const std::string& path, InputNotes* notes, triangulate::BudgetTake* take) {
  const size_t cameras = take->rig.cameras.size();
  take->clocks.assign(cameras, {});
  take->sigma_frames.assign(cameras, std::nan(""));
  if (path.empty()) return;
  const dataset::SyncFile sync = dataset::ReadSync(path);
  notes->inputs.push_back(path);
  const std::vector<std::string> names = CameraNames(take->rig);
  const std::vector<double> offsets = OffsetsOf(sync, names), rates = RatesOf(sync, names);
  for (size_t c = 0; c < cameras; ++c) {
    take->clocks[c] = {offsets[c], rates[c]};
    for (const dataset::SyncedCamera& camera : sync.cameras) {
      if (camera.name == names[c] && camera.offset_frames) take->sigma_frames[c] = camera.sigma_frames;
    }
  }
}

triangulate::BudgetTake ReadTake(const ErrorBudgetOptions& o, const std::optional<FoundTake>& found, InputNotes* notes,
                                 geometry::Skeleton* skeleton) {
  PoseInput input = ReadPoseInput(o.pose, notes);
  if (found) RenumberByClock(*found, o.session, &input);
  triangulate::BudgetTake take;
  take.rig = RigWithTracks(input);
  take.frames = ToFrames(input.tracks, take.rig, o.pose.calib);
  take.body = BodyOf(input.skeleton);
  take.options.sigma_px = o.sigma_px, take.options.min_score = o.min_score, take.options.max_persons = o.max_persons;
  CheckOptions(take.rig, take.options);
  ReadClocks(o.sync, notes, &take);
  *skeleton = input.skeleton;
  return take;
}

geometry::Rig ReadTrueRig(const std::string& path, const geometry::Rig& rig) {
  const geometry::Rig all = ReadCalibrationFiles({path}, {}).rig;
  std::vector<size_t> order;
  for (const geometry::RigCamera& camera : rig.cameras) {
    const int index = all.Find(camera.camera.name);
    if (index < 0)
      throw FormatError(path, "cameras",
                        "no camera " + camera.camera.name + ", which has 2D joints: give the truth of the same cameras");
    order.push_back(static_cast<size_t>(index));
  }
  return SubsetOf(all, order);
}

std::map<int, triangulate::TruePeople> ReadTruePeople(const std::string& path, const geometry::Skeleton& skeleton) {
  const auto scenes = ReadSceneFiles(path);
  const dataset::JointTable table =
      scenes.empty() ? dataset::ToTable(dataset::ReadPoints3d(path).rows) : dataset::ToTable(scenes);
  std::map<int, size_t> index_of;  // by person's number
  for (const auto& frame : table) {
    for (const auto& person : frame.second) index_of.emplace(person.first, index_of.size());
  }
  std::map<int, triangulate::TruePeople> people;
  for (const auto& [frame, persons] : table) {
    triangulate::TruePeople& now = people[frame];
    now.assign(index_of.size(), std::vector<std::optional<Eigen::Vector3d>>(skeleton.joints.size()));
    for (const auto& [person, joints] : persons) {
      for (const auto& [name, row] : joints) {
        const int joint = FindJoint(skeleton, name);
        if (joint >= 0) now[index_of.at(person)][static_cast<size_t>(joint)] = row.x_in_world;
      }
    }
  }
  return people;
}

triangulate::BudgetTruth ReadTruth(const ErrorBudgetOptions& o, const triangulate::BudgetTake& take,
                                   const geometry::Skeleton& skeleton, InputNotes* notes) {
  triangulate::BudgetTruth truth;
  truth.rig = ReadTrueRig(o.truth_calib, take.rig);
  truth.people = ReadTruePeople(o.truth, skeleton);
  truth.offset_frames.assign(take.rig.cameras.size(), 0);
  notes->inputs.insert(notes->inputs.end(), {o.truth, o.truth_calib});
  if (o.truth_sync.empty()) return truth;
  notes->inputs.push_back(o.truth_sync);
  const std::vector<double> offsets = OffsetsOf(dataset::ReadSync(o.truth_sync), CameraNames(take.rig));
  for (size_t c = 0; c < offsets.size(); ++c) {
    if (!std::isfinite(offsets[c]))
      throw FormatError(o.truth_sync, "cameras", "no offset of camera " + take.rig.cameras[c].camera.name);
  }
  truth.offset_frames = offsets;
  return truth;
}

}  // namespace

BudgetInput ReadBudgetInput(ErrorBudgetOptions options, InputNotes* notes) {
  if (options.seeds < 1) throw UsageError("option 'seeds' must be at least 1");
  const std::optional<FoundTake> found = FillFromStudio(&options, notes);
  if (options.pose.calib.empty())
    throw UsageError("option 'calib' is required, or a session that has a calibration (option 'session')");
  BudgetInput input;
  geometry::Skeleton skeleton;
  input.take = ReadTake(options, found, notes, &skeleton);
  input.folder = options.out;
  const bool any = !options.truth.empty() || !options.truth_calib.empty();
  if (!any || options.stated) return input;
  if (options.truth.empty() || options.truth_calib.empty())
    throw UsageError("give the truth whole: option 'truth' (3D joints) and option 'truth-calib'; or leave both out");
  input.truth = ReadTruth(options, input.take, skeleton, notes);
  return input;
}

}  // namespace mvstudio::stages
