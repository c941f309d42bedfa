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

bool Starts(std::string_view head, std::string_view with) { return head.substr(0, with.size()) == with; }
bool Holds(std::string_view head, std::string_view word) { return head.find(word) != std::string_view::npos; }

bool IsHdf5(std::string_view head) { return Starts(head, kHdf5Signature); }
bool IsDeepLabCut(std::string_view head) { return Starts(head, "scorer") || Starts(head, "\"scorer\""); }
bool IsSleap(std::string_view head) { return Holds(head, "frame_idx") && Holds(head, "track"); }
bool IsCaliscope(std::string_view head) { return Holds(head, "sync_index") && Holds(head, "img_loc_x"); }

TrackedPoints ReadHdf5Safely(const std::string& path, const std::string& camera) {
  constexpr internal::ChildLimits kLimits{120, 6ull << 30};
  internal::RunInChild(path, kLimits, [&] {
    ReadTrackerHdf5(path, camera);
    return std::string();
  });
  return ReadTrackerHdf5(path, camera);
}

/// The first that fits is taken.
constexpr TrackerFormat kFormats[] = {
    {"NumPy array", internal::IsPointArray, internal::ReadPointArray},         // .npy, .npz
    {"HDF5 file", IsHdf5, ReadHdf5Safely},                                     // DeepLabCut's .h5 or SLEAP's analysis .h5
    {"DeepLabCut table", IsDeepLabCut, internal::ReadDeepLabCutCsv},           // first line `scorer,…`
    {"SLEAP table", IsSleap, internal::ReadSleapCsv},                          // columns track, frame_idx
    {"caliscope table", IsCaliscope, nullptr},                                 // columns sync_index, img_loc_x
    {"table of 2D points", internal::IsLongCsvHeader, internal::ReadLongCsv},  // columns frame, joint, x, y, a row a point
    {"table of 2D joints", internal::IsWideCsvHeader, internal::ReadWideCsv}   // columns NAME_x, NAME_y, a row a frame
};

}  // namespace

const TrackerFormat* FindTrackerFormat(const std::string& path) {
  std::string head = FirstBytes(path);
  if (!IsHdf5(head)) {
    const std::string extension = std::filesystem::path(path).extension().string();
    if (extension == ".pickle" || extension == ".pkl")
      throw FormatError(path, "", "a Python pickle, which is not read; DeepLabCut's result of a video is its .h5 or .csv");
    if (Starts(head, "\xEF\xBB\xBF")) head.erase(0, 3);
    head.resize(std::min(head.size(), head.find_first_of("\r\n")));
  }
  const auto found = std::find_if(std::begin(kFormats), std::end(kFormats), [&](const auto& f) { return f.fits(head); });
  const bool may_be_wide = found == std::end(kFormats) || found->read == internal::ReadWideCsv;
  if (may_be_wide && internal::NamesSeveralCameras(head))
    throw FormatError(
        path, "line 1",
        "columns of several cameras, as DLTdv and Argus write them (pt1_cam1_X); write a table of columns "
        "camera,frame,joint,x_px,y_px for option 'points2d': their first pixel is 1, so x is 1 less, and y may count "
        "from the lower edge (option 'flip-y')");
  return found == std::end(kFormats) ? nullptr : found;
}

TrackedPoints ReadTrackerHdf5(const std::string& path, const std::string& camera) {
  const internal::ForeignHdf5 file(path);
  if (file.Has("/tracks") && file.Has("/node_names")) return internal::ReadSleapHdf5(file, camera);
  return internal::ReadDeepLabCutHdf5(file, camera);
}

TrackedPoints ReadTrackerFile(const std::string& path, const std::string& camera) {
  const TrackerFormat* format = FindTrackerFormat(path);
  if (!format) throw FormatError(path, "", "is no file of DeepLabCut or SLEAP");
  if (!format->read)
    throw FormatError(path, "line 1", std::string(format->name) + " of all cameras, not of one; give it as option 'points2d'");
  return format->read(path, camera);
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
