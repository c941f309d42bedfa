#include "dataset/session/session_layout.h"

#include <algorithm>
#include <cctype>
#include <set>

#include "core/error.h"
#include "core/join.h"

namespace mvstudio::dataset::internal {
namespace {

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

bool SaysTake(const std::string& name) {
  static const std::set<std::string> words = {"board",   "calib",      "calibration", "checkerboard", "chessboard",
                                              "charuco", "intrinsics", "extrinsics",  "plate"};
  return words.count(Lower(name)) > 0;
}

/// A word for a camera with a number: cam1, gopro_02, Camera-3.
bool SaysCamera(const std::string& name) {
  static const std::set<std::string> words = {"cam", "camera", "gopro", "hero",   "kinect", "webcam", "iphone", "phone", "view",
                                              "hd",  "vga",    "pi",    "basler", "flir",   "camara", "kamera", "c"};
  const std::string text = Lower(name);
  const size_t end = text.find_last_not_of("0123456789");
  if (end == std::string::npos || end + 1 == text.size()) return false;
  const size_t word = text.find_last_not_of("_- ", end);
  return word != std::string::npos && words.count(text.substr(0, word + 1)) > 0;
}

/// GX0123, GOPR0123: a number that a camera counts by itself.
bool IsRecordingName(const std::string& name) {
  for (const std::string prefix : {"GX", "GH", "GS", "GOPR"}) {
    if (name.size() == prefix.size() + 4 && name.rfind(prefix, 0) == 0 &&
        name.find_first_not_of("0123456789", prefix.size()) == std::string::npos)
      return true;
  }
  return false;
}

std::set<std::string> NamesInside(const std::vector<FootageFolder>& folders) {
  std::set<std::string> names;
  for (const FootageFolder& folder : folders) {
    for (const auto& [name, files] : folder.footage) names.insert(name);
  }
  return names;
}

/// How much speaks for `cameras` and `takes` being just that.
int Score(const std::set<std::string>& takes, const std::set<std::string>& cameras) {
  int score = cameras.size() > 1;
  score += std::any_of(takes.begin(), takes.end(), SaysTake) ? 4 : 0;
  score += std::any_of(cameras.begin(), cameras.end(), SaysCamera) ? 2 : 0;
  score -= std::any_of(cameras.begin(), cameras.end(), IsRecordingName) ? 2 : 0;
  return score;
}

std::string Few(const std::set<std::string>& names) {
  constexpr size_t kMost = 4;
  std::vector<std::string> shown;
  for (const std::string& name : names) {
    if (shown.size() < kMost) shown.push_back(name);
  }
  return Join(shown, ", ") + (names.size() > kMost ? ", …" : "");
}

std::string Reading(const std::set<std::string>& takes, const std::set<std::string>& cameras) {
  return "takes " + Few(takes) + " by cameras " + Few(cameras);
}

/// Whether the cameras name their files by counting recordings, each for itself.
bool AreNumbered(const std::vector<FootageFolder>& cameras) {
  const std::set<std::string> names = NamesInside(cameras);
  return std::all_of(names.begin(), names.end(), IsRecordingName);
}

/// Each camera's recordings in order, as take1, take2, …
std::vector<FootageFolder> PairInOrder(const std::string& path, const std::vector<FootageFolder>& cameras, std::string* note) {
  std::vector<FootageFolder> takes(cameras[0].footage.size());
  for (const FootageFolder& camera : cameras) {
    if (camera.footage.size() != takes.size()) {
      throw FormatError(path, "",
                        "camera " + cameras[0].name + " has " + std::to_string(takes.size()) + " recordings and " +
                            camera.name + " " + std::to_string(camera.footage.size()) +
                            ": which belong together cannot be told; put them into folders CAMERA/TAKE/");
    }
    size_t i = 0;
    for (const auto& [name, files] : camera.footage) {
      takes[i].name = "take" + std::to_string(i + 1);
      takes[i++].footage[camera.name] = files;
    }
  }
  *note = "the cameras number their recordings each for itself: they are paired in this order, as take1" +
          std::string(takes.size() > 1 ? " to take" + std::to_string(takes.size()) : "") +
          "; say in mvstudio.toml which is of the board (kind = \"board\")";
  return takes;
}

}  // namespace

FoundLayout FindLayout(const std::vector<FootageFolder>& folders, bool has_plates) {
  std::set<std::string> outside;
  for (const FootageFolder& folder : folders) outside.insert(folder.name);
  const std::set<std::string> inside = NamesInside(folders);
  const int take_first = Score(outside, inside) + (has_plates ? 4 : 0), camera_first = Score(inside, outside);
  FoundLayout found;
  if (folders.size() < 2) return found;
  if (camera_first > take_first) found.layout = SessionLayout::kCameraFirst;
  const bool open = camera_first == take_first && inside.size() > 1;
  if (found.layout == SessionLayout::kTakeFirst && !open) return found;
  const bool chose_camera = found.layout == SessionLayout::kCameraFirst;
  const std::string by_take = Reading(outside, inside), by_camera = Reading(inside, outside);
  found.conflict = "the folders are read as " + (chose_camera ? "CAMERA/TAKE: " + by_camera : "TAKE/CAMERA: " + by_take) +
                   "; option 'layout' " + (chose_camera ? "take-first" : "camera-first") + " reads them as " +
                   (chose_camera ? by_take : by_camera);
  return found;
}

std::vector<FootageFolder> TakesOfCameras(const std::string& path, const std::vector<FootageFolder>& cameras,
                                          std::string* note) {
  const std::set<std::string> names = NamesInside(cameras);
  const bool same =
      std::all_of(cameras.begin(), cameras.end(), [&](const FootageFolder& c) { return c.footage.size() == names.size(); });
  if (!same && AreNumbered(cameras)) return PairInOrder(path, cameras, note);
  std::vector<FootageFolder> takes;
  for (const std::string& name : names) {
    FootageFolder take{name, {}};
    for (const FootageFolder& camera : cameras) {
      const auto found = camera.footage.find(name);
      if (found != camera.footage.end()) take.footage[camera.name] = found->second;
    }
    takes.push_back(std::move(take));
  }
  return takes;
}

}  // namespace mvstudio::dataset::internal
