#include "dataset/pose2d.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/check.h"
#include "core/error.h"
#include "core/files.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kMaxJsonDepth = 16;

/// Last run of digits of the name without `_keypoints` and extension.
std::optional<int> FrameNumber(const std::string& file_name) {
  std::string stem = file_name.substr(0, file_name.rfind('.'));
  const size_t suffix = stem.rfind("_keypoints");
  if (suffix != std::string::npos) stem.resize(suffix);
  size_t end = stem.size();
  while (end > 0 && !std::isdigit(static_cast<unsigned char>(stem[end - 1]))) --end;
  size_t begin = end;
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1]))) --begin;
  if (begin == end) return std::nullopt;
  const std::string digits = stem.substr(begin, end - begin);
  const size_t first = std::min(digits.find_first_not_of('0'), digits.size());
  if (digits.size() - first > 9) return std::nullopt;
  return std::stoi("0" + digits.substr(first));
}

std::vector<fs::path> ListJsonFiles(const std::string& folder, const std::string& camera) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    throw IoError(folder,
                  "camera " + camera + ": no such folder of OpenPose JSON files; check the path after `" + camera + "=`");
  }
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".json" && name[0] != '.' && entry.is_regular_file()) files.push_back(entry.path());
  }
  if (error) throw IoError(folder, "camera " + camera + ": cannot be listed: " + error.message());
  if (files.empty()) {
    throw IoError(folder, "camera " + camera + ": the folder holds no .json file; was the pose detector run on this camera?");
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Where messages say the trouble is, and what the file must hold.
struct FileContext {
  std::string path, place;
  const body::Skeleton& skeleton;

  [[noreturn]] void Fail(const std::string& where, const std::string& what) const {
    throw FormatError(path, place + (where.empty() ? "" : ", " + where), what);
  }
};

json ParseJson(const std::string& text, const FileContext& file) {
  const auto cap_depth = [&file](int depth, json::parse_event_t, json&) {
    if (depth > kMaxJsonDepth) file.Fail("", "JSON nested deeper than " + std::to_string(kMaxJsonDepth) + " levels");
    return true;
  };
  try {
    return json::parse(text, cap_depth);
  } catch (const json::exception& error) {
    const auto* parse_error = dynamic_cast<const json::parse_error*>(&error);
    const size_t byte = parse_error ? parse_error->byte : 0;
    const bool truncated = byte >= text.size();
    file.Fail("", std::string(truncated ? "truncated JSON: it ends" : "damaged JSON: unreadable") + " at byte " +
                      std::to_string(std::min(byte, text.size())) + " of " + std::to_string(text.size()) +
                      "; detect this picture's key points again or remove the file");
  }
}

std::string SkeletonsOfSize(size_t num_joints) {
  std::string fitting;
  for (const std::string& name : body::SkeletonNames()) {
    if (body::SkeletonByName(name).joints.size() == num_joints) fitting += (fitting.empty() ? "" : " or ") + name;
  }
  return fitting.empty() ? "no known skeleton has that many" : "--skeleton " + fitting + " would fit";
}

Person2d ParsePerson(const json& numbers, const std::string& where, const FileContext& file) {
  const size_t expected = file.skeleton.joints.size();
  if (numbers.size() != 3 * expected) {
    file.Fail(where, std::to_string(numbers.size()) + " numbers instead of 3 x " + std::to_string(expected) + " of skeleton " +
                         file.skeleton.name + "; " + SkeletonsOfSize(numbers.size() % 3 ? 0 : numbers.size() / 3));
  }
  Person2d person;
  for (size_t k = 0; k < expected; ++k) {
    for (size_t i = 3 * k; i < 3 * k + 3; ++i) {
      if (!numbers[i].is_number()) file.Fail(where + "[" + std::to_string(i) + "]", "is not a number");
    }
    person.keypoints.push_back(
        {numbers[3 * k].get<double>(), numbers[3 * k + 1].get<double>(), numbers[3 * k + 2].get<double>()});
  }
  return person;
}

std::vector<Person2d> ParsePeople(const json& root, const FileContext& file) {
  if (!root.is_object() || !root.contains("people") || !root["people"].is_array()) {
    file.Fail("people", "there is no array \"people\"; this is not an OpenPose key-point file");
  }
  std::vector<Person2d> people;
  for (size_t i = 0; i < root["people"].size(); ++i) {
    const json& entry = root["people"][i];
    const std::string where = "people[" + std::to_string(i) + "].pose_keypoints_2d";
    if (!entry.is_object()) file.Fail("people[" + std::to_string(i) + "]", "is not an object");
    // A face or a hand without a body; Pose2Sim leaves {} where it found nobody.
    if (!entry.contains("pose_keypoints_2d") || (entry["pose_keypoints_2d"].is_array() && entry["pose_keypoints_2d"].empty()))
      continue;
    if (!entry["pose_keypoints_2d"].is_array()) file.Fail(where, "is not an array");
    people.push_back(ParsePerson(entry["pose_keypoints_2d"], where, file));
  }
  return people;
}

json PersonToJson(const Person2d& person) {
  json numbers = json::array();
  for (const Keypoint2d& point : person.keypoints) {
    numbers.push_back(point.x_px);
    numbers.push_back(point.y_px);
    numbers.push_back(point.score);
  }
  json entry = {{"person_id", json::array({-1})}, {"pose_keypoints_2d", std::move(numbers)}};
  for (const char* empty : {"face_keypoints_2d", "hand_left_keypoints_2d", "hand_right_keypoints_2d", "pose_keypoints_3d",
                            "face_keypoints_3d", "hand_left_keypoints_3d", "hand_right_keypoints_3d"}) {
    entry[empty] = json::array();
  }
  return entry;
}

}  // namespace

Pose2dTrack ReadOpenPoseFolder(const std::string& folder, const std::string& camera, const body::Skeleton& skeleton) {
  Pose2dTrack track{camera, {}};
  for (const fs::path& path : ListJsonFiles(folder, camera)) {
    const std::optional<int> frame = FrameNumber(path.filename().string());
    if (!frame) {
      throw FormatError(path.string(), "camera " + camera,
                        "the file name holds no frame number (at most 9 digits before _keypoints.json)");
    }
    const FileContext file{path.string(), "camera " + camera + ", frame " + std::to_string(*frame), skeleton};
    if (track.frames.count(*frame)) file.Fail("", "another file of this folder has the same frame number");
    track.frames[*frame] = ParsePeople(ParseJson(ReadFile(path.string()), file), file);
  }
  return track;
}

void WriteOpenPoseFolder(const Pose2dTrack& track, const std::string& folder) {
  MakeFolder(folder);
  for (const auto& [frame, people] : track.frames) {
    MVS_CHECK(frame >= 0, "camera " << track.camera << ": frame " << frame << " is negative");
    json root = {{"version", 1.3}, {"people", json::array()}};
    for (const Person2d& person : people) root["people"].push_back(PersonToJson(person));
    char name[64];
    std::snprintf(name, sizeof name, "%012d_keypoints.json", frame);
    WriteFileAtomic((fs::path(folder) / name).string(), root.dump());
  }
}

}  // namespace mvstudio::dataset
