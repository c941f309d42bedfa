#include "stages/view/scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "calib/formats/formats.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/statistics.h"
#include "dataset/footage/frames.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/markers.h"
#include "dataset/session/session_scan.h"
#include "stages/input/calib_read.h"
#include "stages/input/pose_input.h"
#include "stages/input/session_input.h"
#include "stages/input/take_input.h"
#include "stages/view/scene_parts.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

constexpr char kSessionFile[] = "mvstudio.toml";

bool IsFolder(const std::string& path) {
  std::error_code none;
  return fs::is_directory(path, none);
}
bool IsThere(const std::string& path) {
  std::error_code none;
  return fs::exists(path, none);
}

/// Whether a path that belongs to the scene may be read: it lies in its folder, links followed.
bool MayRead(const Scene& scene, const std::string& path) { return scene.root.empty() || LiesIn(path, scene.root); }

/// The same of something that is there; what may not is a warning.
bool MayShow(const Scene& scene, const std::string& what, const std::string& path, InputNotes* notes) {
  if (MayRead(scene, path)) return true;
  notes->warnings.push_back(
      {"VIEW-LEFTOUT", what + " " + path + ": a link leads outside of " + scene.root + "; option 'allow-outside' shows it",
       "the rest is shown"});
  notes->partial = true;
  return false;
}

void SetRig(geometry::Rig rig, Scene* scene) {
  scene->rig = std::move(rig);
  for (SceneCamera& camera : scene->cameras) camera.rig_idx = scene->rig.Find(camera.name);
  if (!scene->cameras.empty()) return;
  for (size_t c = 0; c < scene->rig.cameras.size(); ++c)
    scene->cameras.push_back({scene->rig.cameras[c].camera.name, static_cast<int>(c), "", ""});
}

/// What cannot be read is a warning: the rest is shown.
template <class Read>
void Try(const std::string& what, InputNotes* notes, const Read& read) {
  try {
    read();
  } catch (const CancelledError&) {
    throw;
  } catch (const Error& error) {
    notes->warnings.push_back({"VIEW-LEFTOUT", what + " are not shown: " + error.what(), "the rest is"});
    notes->partial = true;
  }
}

void AddJoints(const std::string& folder, Scene* scene, InputNotes* notes) {
  const std::string points = folder + "/points.csv";
  if (!IsThere(points) || !MayShow(*scene, "3D joints", points, notes)) return;
  Try("3D joints", notes, [&] {
    UsePose3d(dataset::ReadPose3d(folder), scene);
    notes->inputs.push_back(folder);
  });
}

/// 2D joints of a folder with one of each camera.
void AddDetections(const std::string& calib, const std::string& folder, Scene* scene, InputNotes* notes) {
  PoseArguments pose;
  pose.calib = calib, pose.lenses_suffice = true;
  for (const SceneCamera& camera : scene->cameras) {
    const std::string of_camera = folder + "/" + dataset::Slug(camera.name);
    if (IsFolder(of_camera) && camera.rig_idx >= 0 && MayShow(*scene, "2D joints", of_camera, notes))
      pose.pose2d.push_back({camera.name, of_camera});
  }
  if (pose.pose2d.size() < 2) return;
  Try("2D joints", notes, [&] {
    PoseInput input = ReadPoseInput(pose, notes);
    scene->detected_skeleton = input.skeleton;
    for (dataset::Pose2dTrack& track : input.tracks) scene->detections[track.camera] = std::move(track);
  });
}

void ReadSessionScene(const ViewSceneOptions& options, Scene* scene, InputNotes* notes) {
  const auto found = FindTake({options.path, options.take, options.allow_outside}, notes);
  const dataset::Session& session = found->session;
  const std::string& take = found->take.name;
  const auto in_session = [&](const std::string& kind) { return dataset::TakeFolder(session, kind, take); };
  scene->title += ", " + take, scene->report_folder = session.folder;
  for (const dataset::SessionFootage& f : found->take.footage) {
    const std::string masks = dataset::TakeFolder(session, "masks", take, f.camera);
    scene->cameras.push_back(
        {f.camera, -1, dataset::ResolveInSession(session, f.path, options.allow_outside), IsFolder(masks) ? masks : ""});
    notes->inputs.push_back(scene->cameras.back().footage);
  }
  if (!session.trusted.empty() || session.allow_outside) scene->root.clear();  // checked by ResolveInSession
  Try("held-out images", notes, [&] { ReadHeldOut(in_session("avatar"), scene); });
  scene->fps_hz = found->take.fps_hz.value_or(session.fps_hz.value_or(0));
  Try("time stamps", notes, [&] { scene->timeline = TimelineOf(session, found->take, options.allow_outside, true, notes); });
  const std::string calib = dataset::CalibrationOf(session, options.allow_outside);
  if (calib.empty()) return;
  Try("lenses", notes, [&] { SetRig(ReadCalibrationFiles({calib}, {}).rig, scene); });
  notes->inputs.push_back(calib);
  AddJoints(in_session("pose3d"), scene, notes);
  AddDetections(calib, in_session("pose2d"), scene, notes);
}

bool IsDataset(const std::string& folder) { return IsFolder(folder + "/hdImgs"); }

void ReadDatasetScene(const std::string& folder, Scene* scene, InputNotes* notes) {
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(folder);
  for (const geometry::RigCamera& camera : data.rig.cameras) {
    const std::string& name = camera.camera.name;
    const std::string masks = folder + "/masks/" + name;
    scene->cameras.push_back({name, -1, folder + "/hdImgs/" + name, IsFolder(masks) ? masks : ""});
  }
  SetRig(data.rig, scene);
  scene->steps = data.frames;
  UseCoco19(data.poses, scene);
  notes->inputs.push_back(folder);
  AddDetections(dataset::FindPanopticCalibration(folder), folder + "/pose2d", scene, notes);
}

/// The folder of a run with images: itself, or the dataset in it.
std::string DatasetIn(const std::string& folder) {
  if (IsDataset(folder)) return folder;
  std::vector<std::string> found;
  for (const std::string& parent : {folder, folder + "/dataset"}) {
    std::error_code none;
    for (fs::directory_iterator at(parent, none), end; !none && at != end; at.increment(none)) {
      if (at->is_directory(none) && IsDataset(at->path().string())) found.push_back(at->path().string());
    }
  }
  std::sort(found.begin(), found.end());
  return found.empty() ? "" : found.front();
}

/// Footage without anything else: videos, a folder of images for each camera, or the images of one.
void AddFootage(const std::string& folder, Scene* scene, InputNotes* notes) {
  std::vector<dataset::SessionCamera> cameras;
  const dataset::SessionTake take = dataset::ScanFolder(folder, &cameras);
  const auto is_image = [&](const dataset::SessionFootage& footage) {
    return !IsFolder(folder + "/" + footage.path) && !dataset::IsVideoFile(footage.path);
  };
  if (take.footage.empty()) return;
  scene->kind = "footage";
  if (std::all_of(take.footage.begin(), take.footage.end(), is_image)) {
    scene->cameras.push_back({take.name, -1, folder, ""});
    return;
  }
  for (const dataset::SessionFootage& footage : take.footage) {
    const std::string path = folder + "/" + footage.path;
    if (!is_image(footage) && MayShow(*scene, "footage", path, notes)) scene->cameras.push_back({footage.camera, -1, path, ""});
  }
}

/// Of takes whose joints state no residual: the median over the cameras' 2D joints, unless that takes long.
void AddErrorsOfDetections(Scene* scene) {
  constexpr size_t kMostViews = 20'000;
  if (!scene->error_px.empty() || scene->detections.empty() || scene->joints.size() * scene->cameras.size() > kMostViews)
    return;
  for (const auto& [step, people] : scene->joints) {
    std::vector<double> errors;
    for (size_t c = 0; c < scene->cameras.size(); ++c) errors.push_back(MedianResidualPx(ViewAt(*scene, c, step)));
    if (const double median = LinearQuantile(FiniteValues(errors), 0.5); std::isfinite(median)) scene->error_px[step] = median;
  }
}

void ReadFolderScene(const ViewSceneOptions& options, Scene* scene, InputNotes* notes) {
  const std::string& folder = options.path;
  const std::string images = DatasetIn(folder);
  scene->kind = images == folder ? "dataset" : "run", scene->report_folder = folder;
  if (!images.empty() && MayShow(*scene, "the dataset", images, notes)) {
    ReadDatasetScene(images, scene, notes);
  } else if (IsThere(calib::CalibrationIn(folder)) && calib::CalibrationIn(folder) != folder) {
    Try("lenses", notes, [&] { SetRig(ReadCalibrationFiles({folder}, {}).rig, scene); });
  }
  for (const char* place : {"", "/avatar"}) Try("held-out images", notes, [&] { ReadHeldOut(folder + place, scene); });
  AddJoints(folder + "/pose3d", scene, notes);
  if (scene->joints.empty()) AddJoints(folder, scene, notes);
  const bool has_results = !FilesNamed(folder, "", ".result.json").empty();
  if (scene->cameras.empty() && scene->joints.empty() && !has_results) AddFootage(folder, scene, notes);
  notes->inputs.push_back(folder);
}

bool IsPointsFile(const std::string& path) {
  const std::string end = fs::path(path).extension().string();
  return end == ".trc" || end == ".c3d" || fs::path(path).filename() == "points.csv";
}

void ReadFileScene(const ViewSceneOptions& options, Scene* scene, InputNotes* notes) {
  notes->inputs.push_back(options.path);
  if (IsPointsFile(options.path)) {
    scene->kind = "points";
    UsePose3d(dataset::ReadPoints3d(options.path), scene);
    if (scene->joints.empty()) throw FormatError(options.path, "", "holds no point");
    return;
  }
  if (dataset::IsVideoFile(options.path)) {
    scene->kind = "footage";
    scene->cameras.push_back({fs::path(options.path).stem().string(), -1, options.path, ""});
    return;
  }
  scene->kind = "calibration";
  const calib::ImportedRig given = ReadCalibrationFiles({options.path}, {});
  AddNotes(given.notes, notes);
  SetRig(given.rig, scene);
}

/// Time steps that joints, the timeline or the footage have.
void FindSteps(Scene* scene) {
  std::set<int> steps(scene->steps.begin(), scene->steps.end());
  for (const auto& [step, people] : scene->joints) steps.insert(step);
  if (scene->timeline) {
    for (int64_t i = 0; i < scene->timeline->num_time_steps; ++i) steps.insert(static_cast<int>(i));
  } else if (scene->steps.empty()) {
    for (const SceneCamera& camera : scene->cameras) {
      if (camera.footage.empty()) continue;
      const std::vector<int64_t> numbers = FrameNumbersOf(camera.footage);
      steps.insert(numbers.begin(), numbers.end());
    }
  }
  scene->steps.assign(steps.begin(), steps.end());
}

}  // namespace

Scene ReadScene(const ViewSceneOptions& options, InputNotes* notes) {
  if (!IsThere(options.path)) throw IoError(options.path, "is not there");
  ViewSceneOptions o = options;
  while (o.path.size() > 1 && o.path.back() == '/') o.path.pop_back();
  Scene scene;
  scene.title = fs::path(PathOnDisk(o.path)).filename().string();
  if (fs::path(o.path).filename() == kSessionFile) o.path = fs::path(o.path).parent_path().string();
  const bool is_session = IsThere(o.path + "/" + kSessionFile);
  if (!is_session && !o.take.empty()) throw UsageError("option 'take': " + o.path + " is no session");
  if (IsFolder(o.path) && !o.allow_outside) scene.root = o.path;
  if (is_session) {
    scene.kind = "session";
    ReadSessionScene(o, &scene, notes);
  } else if (IsFolder(o.path)) {
    ReadFolderScene(o, &scene, notes);
  } else {
    ReadFileScene(o, &scene, notes);
  }
  FindSteps(&scene);
  AddErrorsOfDetections(&scene);
  const bool has_footage =
      std::any_of(scene.cameras.begin(), scene.cameras.end(), [](const SceneCamera& c) { return !c.footage.empty(); });
  if (!has_footage && !scene.joints.empty() && scene.cameras.empty()) AddPlainCameras(&scene);
  return scene;
}

}  // namespace mvstudio::stages
