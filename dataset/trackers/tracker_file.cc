#include "dataset/trackers/tracker_file.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/arrays/child_process.h"
#include "dataset/trackers/tracker_readers.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset {
namespace {

constexpr std::string_view kHdf5Signature = "\x89HDF\r\n\x1a\n";

/// The first line, at most 64 KiB of it.
std::string FirstBytes(const std::string& path) {
  constexpr size_t kHead = 1 << 16;
  RequireRegularFile(path);
  std::string head(kHead, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  if (file.bad() || (!file && !file.eof())) throw IoError(path, "cannot be read");
  head.resize(static_cast<size_t>(file.gcount()));
  return head;
}

bool Holds(const std::string& line, std::string_view word) { return line.find(word) != std::string::npos; }

}  // namespace

TrackerKind DetectTracker(const std::string& path) {
  std::string head = FirstBytes(path);
  if (head.compare(0, kHdf5Signature.size(), kHdf5Signature) == 0) return TrackerKind::kHdf5;
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".pickle" || extension == ".pkl") {
    throw FormatError(path, "", "a Python pickle, which is not read; DeepLabCut's result of a video is its .h5 or .csv");
  }
  if (head.compare(0, 3, "\xEF\xBB\xBF") == 0) head.erase(0, 3);
  const std::string line = head.substr(0, head.find_first_of("\r\n"));
  if (line.compare(0, 6, "scorer") == 0 || line.compare(0, 8, "\"scorer\"") == 0) return TrackerKind::kDeepLabCutCsv;
  if (Holds(line, "frame_idx") && Holds(line, "track")) return TrackerKind::kSleapCsv;
  if (Holds(line, "sync_index") && Holds(line, "img_loc_x")) return TrackerKind::kCaliscopeCsv;
  if (internal::NamesSeveralCameras(line))
    throw FormatError(
        path, "line 1",
        "columns of several cameras, as DLTdv and Argus write them (pt1_cam1_X); write a table of columns "
        "camera,frame,joint,x_px,y_px for option 'points2d': their first pixel is 1, so x is 1 less, and y may count "
        "from the lower edge (option 'flip-y')");
  if (internal::IsWideCsvHeader(line)) return TrackerKind::kWideCsv;
  return TrackerKind::kNone;
}

std::string_view ToString(TrackerKind kind) {
  switch (kind) {
    case TrackerKind::kNone:
      return "other file";
    case TrackerKind::kHdf5:
      return "HDF5 file";
    case TrackerKind::kDeepLabCutCsv:
      return "DeepLabCut table";
    case TrackerKind::kSleapCsv:
      return "SLEAP table";
    case TrackerKind::kWideCsv:
      return "table of 2D joints";
    case TrackerKind::kCaliscopeCsv:
      return "caliscope table";
  }
  return "other file";
}

TrackedPoints ReadTrackerHdf5(const std::string& path, const std::string& camera) {
  const internal::ForeignHdf5 file(path);
  if (file.Has("/tracks") && file.Has("/node_names")) return internal::ReadSleapHdf5(file, camera);
  return internal::ReadDeepLabCutHdf5(file, camera);
}

TrackedPoints ReadTrackerFile(const std::string& path, const std::string& camera) {
  switch (DetectTracker(path)) {
    case TrackerKind::kHdf5: {
      constexpr internal::ChildLimits kLimits{120, 6ull << 30};
      internal::RunInChild(path, kLimits, [&] {
        ReadTrackerHdf5(path, camera);
        return std::string();
      });
      return ReadTrackerHdf5(path, camera);
    }
    case TrackerKind::kDeepLabCutCsv:
      return internal::ReadDeepLabCutCsv(path, camera);
    case TrackerKind::kSleapCsv:
      return internal::ReadSleapCsv(path, camera);
    case TrackerKind::kWideCsv:
      return internal::ReadWideCsv(path, camera);
    case TrackerKind::kCaliscopeCsv:
      throw FormatError(path, "line 1", "caliscope's table of all cameras, not of one; give it as option 'points2d'");
    case TrackerKind::kNone:
      break;
  }
  throw FormatError(path, "", "is no file of DeepLabCut or SLEAP");
}

std::vector<std::string> UnitedJoints(const std::vector<TrackedPoints>& cameras) {
  std::vector<std::string> joints;
  for (const TrackedPoints& camera : cameras) {
    for (const std::string& joint : camera.joints) {
      if (std::find(joints.begin(), joints.end(), joint) == joints.end()) joints.push_back(joint);
    }
  }
  return joints;
}

std::vector<Pose2dTrack> ToSkeleton(std::vector<TrackedPoints> cameras, const geometry::Skeleton& skeleton) {
  std::vector<Pose2dTrack> tracks;
  for (TrackedPoints& camera : cameras) {
    const std::string twice = geometry::TwiceTheSameJoint(skeleton, camera.joints);
    if (!twice.empty())
      throw FormatError("camera " + camera.track.camera, camera.program + " file",
                        twice + " are the same joint of skeleton " + skeleton.name + "; rename one of them");
    std::vector<size_t> place_of;
    for (const std::string& joint : camera.joints) {
      const int place = geometry::FindJoint(skeleton, joint);
      if (place < 0) {
        throw FormatError("camera " + camera.track.camera, camera.program + " file",
                          geometry::UnknownJoint(skeleton, joint) +
                              "; add it there, or leave option 'skeleton' out to take the joints from the file");
      }
      place_of.push_back(static_cast<size_t>(place));
    }
    for (auto& [frame, people] : camera.track.frames) {
      for (Person2d& person : people) {
        std::vector<Keypoint2d> keypoints(skeleton.joints.size());
        for (size_t j = 0; j < place_of.size(); ++j) keypoints[place_of[j]] = person.keypoints[j];
        person.keypoints = std::move(keypoints);
      }
    }
    tracks.push_back(std::move(camera.track));
  }
  return tracks;
}

}  // namespace mvstudio::dataset
