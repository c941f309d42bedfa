#include "dataset/pose/pose2d.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <set>
#include <string_view>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/format.h"
#include "core/join.h"
#include "core/json_tree.h"
#include "dataset/footage/frame_numbers.h"
#include "dataset/pose/pose2d_parse.h"

namespace mvstudio::dataset {
namespace internal {

using nlohmann::json;

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

std::map<std::string, std::optional<int>> FramesOfNames(const std::vector<std::string>& names) {
  constexpr std::string_view kSuffix = "_keypoints";
  std::map<std::string, std::optional<int>> frames;
  std::set<int> distinct;
  std::vector<std::string> plain;
  for (const std::string& name : names) {
    const std::optional<int> frame = frames[name] = FrameNumber(name);
    if (frame) distinct.insert(*frame);
    const size_t suffix = name.rfind(kSuffix);
    plain.push_back(suffix == std::string::npos ? name : name.substr(0, suffix) + name.substr(suffix + kSuffix.size()));
  }
  if (distinct.size() == frames.size()) return frames;
  const std::vector<int64_t> numbers = NumberFrames("", plain).numbers;
  for (size_t i = 0; i < names.size(); ++i) {
    const bool numbered = plain[i].find_first_of("0123456789") != std::string::npos && numbers[i] <= 999'999'999;
    frames[names[i]] = numbered ? std::optional<int>(static_cast<int>(numbers[i])) : std::nullopt;
  }
  return frames;
}

json ParsePoseJson(const std::string& text, const PoseFile& file) {
  constexpr size_t kMaxDepth = 16;
  const size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (first != std::string::npos && std::string_view("{[").find(text[first]) == std::string_view::npos)
    file.Fail(
        "", std::string(text[first] == '<' ? "XML" : "a text") +
                ", no JSON: 2D joints are JSON (OpenPose, COCO, MMPose, AlphaPose), or tables of DeepLabCut, of SLEAP or with "
                "columns frame, nose_x, nose_y, nose_score, …" +
                (text[first] == '<' ? "; export from CVAT as COCO Keypoints" : ""));
  json parsed;
  const JsonProblem problem = ParseJsonTree(text, {kMaxDepth, false, true}, &parsed);
  if (problem.kind == JsonProblem::Kind::kNone) return parsed;
  if (problem.kind == JsonProblem::Kind::kDepth)
    file.Fail("", "JSON nested deeper than " + std::to_string(kMaxDepth) + " levels");
  const bool truncated = problem.byte >= text.size();
  file.Fail("", std::string(truncated ? "truncated JSON: it ends" : "damaged JSON: unreadable") + " at byte " +
                    std::to_string(std::min(problem.byte, text.size())) + " of " + std::to_string(text.size()) +
                    "; detect this image's keypoints again, or copy its file again");
}

std::string FittingSkeletons(size_t num_joints) {
  const std::string fitting = Join(geometry::SkeletonsOfSize(num_joints), " or ");
  return fitting.empty() ? "no known skeleton has that many" : "option 'skeleton' " + fitting + " would fit";
}

void AppendKeypoints(const json& numbers, size_t num_joints, const std::string& where, const PoseFile& file, Person2d* person) {
  if (numbers.size() != 3 * num_joints) {
    file.Fail(where, std::to_string(numbers.size()) + " numbers instead of 3 x " + std::to_string(num_joints) +
                         " of skeleton " + file.skeleton.name + "; " +
                         FittingSkeletons(numbers.size() % 3 ? 0 : numbers.size() / 3));
  }
  const auto number = [&](size_t i) {
    if (numbers[i].is_null()) return std::nan("");  // NaN in Python
    if (!numbers[i].is_number()) file.Fail(where + "[" + std::to_string(i) + "]", "is not a number");
    return numbers[i].get<double>();
  };
  for (size_t k = 0; k < numbers.size(); k += 3) {
    const Keypoint2d key{number(k), number(k + 1), number(k + 2)};
    person->keypoints.push_back(std::isfinite(key.x_px + key.y_px + key.score) ? key : Keypoint2d());
  }
}

void Tolerant::Try(const std::function<void()>& read) {
  ++num_tried_;
  try {
    read();
  } catch (const FormatError& error) {
    ++num_failed_;
    if (!first_) first_ = error;
    skipped_->push_back(error.what());
    constexpr int64_t kHopeless = 10000;  // and nearly all: not worth a line each for millions
    if (num_failed_ >= kHopeless && 100 * num_failed_ > 99 * num_tried_) throw FormatError(*first_);
  }
}

void Tolerant::Finish() const {
  if (2 * num_failed_ > num_tried_) throw FormatError(*first_);
}

}  // namespace internal

namespace {

namespace fs = std::filesystem;
using internal::PoseFile;
using nlohmann::json;
using Kind = geometry::SkeletonPart::Kind;

const char* ListOf(Kind kind) {
  switch (kind) {
    case Kind::kFace:
      return "face_keypoints_2d";
    case Kind::kLeftHand:
      return "hand_left_keypoints_2d";
    case Kind::kRightHand:
      return "hand_right_keypoints_2d";
    case Kind::kBody:
      break;
  }
  return "pose_keypoints_2d";
}

/// The .json files, else YOLO's labels.
std::vector<fs::path> ListPoseFiles(const std::string& folder, const std::string& camera) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    const bool there = fs::exists(folder, error);
    throw IoError(folder, "camera " + camera +
                              (there ? ": is neither a folder of OpenPose JSON files nor a file that is known"
                                     : ": no such file or folder of 2D poses") +
                              "; check the path after `" + camera + "=`");
  }
  std::vector<fs::path> files, labels;
  std::error_code unknown;  // a link that leads nowhere is no file
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name[0] == '.' || !entry.is_regular_file(unknown)) continue;
    if (entry.path().extension() == ".json") files.push_back(entry.path());
    if (entry.path().extension() == ".txt" && name != "classes.txt") labels.push_back(entry.path());
  }
  if (files.empty()) files = std::move(labels);
  if (error) throw IoError(folder, "camera " + camera + ": cannot be listed: " + error.message());
  if (files.empty()) {
    throw IoError(folder,
                  "camera " + camera + ": the folder holds no .json or .txt file; was the pose detector run on this camera?");
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// One of OpenPose's lists, which its first versions called `pose_keypoints`; null when it is not there or empty.
const json* FindList(const json& entry, const char* name, const std::string& where, const PoseFile& file) {
  auto list = entry.find(name);
  if (list == entry.end()) list = entry.find(std::string_view(name).substr(0, std::string_view(name).rfind("_2d")));
  if (list == entry.end() || list->is_null()) return nullptr;
  if (!list->is_array()) file.Fail(where + name, "is not an array");
  return list->empty() ? nullptr : &*list;
}

Person2d ParsePerson(const json& entry, const json& pose, const std::string& where, const PoseFile& file) {
  const geometry::Skeleton& skeleton = file.skeleton;
  Person2d person;
  if (skeleton.parts.empty() || pose.size() == 3 * skeleton.joints.size()) {
    internal::AppendKeypoints(pose, skeleton.joints.size(), where + ListOf(Kind::kBody), file, &person);
    return person;
  }
  for (const geometry::SkeletonPart& part : skeleton.parts) {
    const json* list = FindList(entry, ListOf(part.kind), where, file);
    const size_t count = static_cast<size_t>(part.count);
    if (list) {
      internal::AppendKeypoints(*list, count, where + ListOf(part.kind), file, &person);
    } else {
      person.keypoints.resize(person.keypoints.size() + count);
    }
  }
  return person;
}

/// Whether a person has one of OpenPose's lists, be it empty.
bool HasAnyList(const json& entry) {
  return std::any_of(entry.items().begin(), entry.items().end(), [](const auto& item) {
    return item.key().find("_keypoints") != std::string::npos || item.key() == "person_id";
  });
}

std::vector<Person2d> ParsePeopleAsListed(const json& root, const PoseFile& file) {
  const json* const list = root.is_array()                                      ? &root
                           : root.is_object() && root.contains("instance_info") ? &root["instance_info"]
                           : root.is_object() && root.contains("annots")        ? &root["annots"]
                                                                                : nullptr;
  if (list && list->is_array()) {  // MMPose, OpenPifPaf, Ultralytics, EasyMocap
    std::vector<Person2d> people;
    for (size_t i = 0; i < list->size(); ++i) internal::AppendPerson((*list)[i], "[" + std::to_string(i) + "]", file, &people);
    return people;
  }
  if (!root.is_object() || !root.contains("people") || !root["people"].is_array()) {
    file.Fail("people",
              "there is no array \"people\", nor a list of people: no file of OpenPose, MMPose, OpenPifPaf, Ultralytics or "
              "EasyMocap");
  }
  std::vector<Person2d> people;
  for (size_t i = 0; i < root["people"].size(); ++i) {
    const json& entry = root["people"][i];
    const std::string where = "people[" + std::to_string(i) + "]";
    if (!entry.is_object()) file.Fail(where, "is not an object");
    // A face or a hand without a body is nobody; Pose2Sim leaves {} where it found nobody.
    const json* pose = FindList(entry, ListOf(Kind::kBody), where + ".", file);
    if (!pose && !entry.empty() && !HasAnyList(entry)) file.Fail(where, "has no list pose_keypoints_2d");
    if (pose) people.push_back(ParsePerson(entry, *pose, where + ".", file));
  }
  return people;
}

/// In the order of the file's skeleton, whatever order the file names.
std::vector<Person2d> ParsePeople(const json& root, const PoseFile& file) {
  const std::optional<geometry::Skeleton> stated = internal::StatedSkeleton(root);
  if (!stated) return ParsePeopleAsListed(root, file);
  std::vector<Person2d> people = ParsePeopleAsListed(root, {file.path, file.place, *stated});
  internal::ToAskedJoints(*stated, internal::MayLeaveOutJoints(root), file, &people);
  return people;
}

std::map<int, fs::path> FilesByFrame(const std::string& folder, const std::string& camera) {
  std::map<int, fs::path> files;
  const std::vector<fs::path> paths = ListPoseFiles(folder, camera);
  std::vector<std::string> names;
  for (const fs::path& path : paths) names.push_back(path.filename().string());
  const std::map<std::string, std::optional<int>> frames = internal::FramesOfNames(names);
  for (const fs::path& path : paths) {
    const std::optional<int> frame = frames.at(path.filename().string());
    if (!frame) {
      throw FormatError(path.string(), "camera " + camera,
                        "the file name holds no frame number (at most 9 digits before _keypoints.json)");
    }
    if (!files.emplace(*frame, path).second) {
      throw FormatError(path.string(), "camera " + camera + ", frame " + std::to_string(*frame),
                        "another file of this folder has the same frame number");
    }
  }
  return files;
}

json FlatList(const Person2d& person, size_t first, size_t count) {
  json numbers = json::array();
  for (size_t k = first; k < first + count; ++k) {
    const Keypoint2d& point = person.keypoints[k];
    for (const double value : {point.x_px, point.y_px, point.score}) numbers.push_back(value);
  }
  return numbers;
}

json PersonToJson(const Person2d& person, const geometry::Skeleton* skeleton) {
  json entry = {{"person_id", json::array({-1})}};
  for (const char* empty : {"face_keypoints_2d", "hand_left_keypoints_2d", "hand_right_keypoints_2d", "pose_keypoints_3d",
                            "face_keypoints_3d", "hand_left_keypoints_3d", "hand_right_keypoints_3d"}) {
    entry[empty] = json::array();
  }
  if (!skeleton || skeleton->parts.empty()) {
    entry[ListOf(Kind::kBody)] = FlatList(person, 0, person.keypoints.size());
    return entry;
  }
  for (const geometry::SkeletonPart& part : skeleton->parts) {
    entry[ListOf(part.kind)] = FlatList(person, static_cast<size_t>(part.first), static_cast<size_t>(part.count));
  }
  return entry;
}

}  // namespace

OpenPoseFolder::OpenPoseFolder(const std::string& folder, const std::string& camera) : folder_(folder), camera_(camera) {
  for (const auto& [frame, path] : FilesByFrame(folder, camera)) files_.emplace_back(frame, path.filename().string());
}

std::vector<int> OpenPoseFolder::Frames() const {
  std::vector<int> frames;
  for (const auto& [frame, name] : files_) frames.push_back(frame);
  return frames;
}

Pose2dTrack OpenPoseFolder::Read(const geometry::Skeleton& skeleton, const FrameRange& range) const {
  Pose2dTrack track{camera_, {}};
  internal::Tolerant tolerant(&track.skipped);
  size_t at = 0;
  auto file_at = std::lower_bound(files_.begin(), files_.end(), std::pair(range.first, std::string()));
  for (; file_at != files_.end() && file_at->first <= range.last; ++file_at) {
    if (at++ % range.every != 0) continue;
    const int number = file_at->first;
    const fs::path path = fs::path(folder_) / file_at->second;
    const PoseFile file{path.string(), "camera " + camera_ + ", frame " + std::to_string(number), skeleton};
    const bool yolo = path.extension() == ".txt";
    track.normalized = yolo, track.every_frame = !yolo;  // Ultralytics writes no file for a frame without people
    tolerant.Try([&, text_path = path.string()] {
      const std::string text = ReadFile(text_path);
      track.frames[number] =
          yolo ? internal::ParseYoloLabels(text, file) : ParsePeople(internal::ParsePoseJson(text, file), file);
    });
  }
  if (!range.is_part) tolerant.Finish();
  return track;
}

std::vector<int> OpenPoseFrames(const std::string& folder, const std::string& camera) {
  return OpenPoseFolder(folder, camera).Frames();
}

Pose2dTrack ReadOpenPoseFolder(const std::string& folder, const std::string& camera, const geometry::Skeleton& skeleton,
                               const FrameRange& range) {
  return OpenPoseFolder(folder, camera).Read(skeleton, range);
}

Pose2dTrack ReadPose2d(const std::string& path, const std::string& camera, const geometry::Skeleton& skeleton) {
  std::error_code error;
  const bool is_file = fs::exists(path, error) && !fs::is_directory(path, error);
  return is_file ? ReadPoseResults(path, camera, skeleton) : ReadOpenPoseFolder(path, camera, skeleton);
}

void WriteOpenPoseFolder(const Pose2dTrack& track, const std::string& folder, const geometry::Skeleton* skeleton) {
  MakeFolder(folder);
  for (const auto& [frame, people] : track.frames) {
    MVS_CHECK(frame >= 0, "camera " << track.camera << ": frame " << frame << " is negative");
    json root = {{"version", 1.3}, {"people", json::array()}};
    for (const Person2d& person : people) {
      MVS_CHECK(!skeleton || person.keypoints.size() == skeleton->joints.size(), person.keypoints.size() << " keypoints");
      root["people"].push_back(PersonToJson(person, skeleton));
    }
    WriteFileAtomic((fs::path(folder) / Format("%012d_keypoints.json", frame)).string(), root.dump());
  }
}

}  // namespace mvstudio::dataset
