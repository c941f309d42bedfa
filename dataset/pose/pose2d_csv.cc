#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <string_view>
#include <tuple>
#include <unordered_map>

#include "core/check.h"
#include "core/csv.h"
#include "core/disk/files.h"
#include "core/disk/pieces.h"
#include "core/label.h"
#include "core/text/number_cell.h"
#include "core/text/row_times.h"
#include "core/text/shortest_text.h"
#include "dataset/pose/marker_formats.h"
#include "dataset/pose/pose2d_parse.h"
#include "dataset/pose/score_scale.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset {
namespace {

enum Column { kCamera, kFrame, kPerson, kJoint, kX, kY, kScore, kNumColumns };
constexpr const char* kNames[kNumColumns] = {"camera", "frame", "person", "joint", "x_px", "y_px", "score"};
/// The same columns as other programs call them.
constexpr std::pair<std::string_view, Column> kOtherNames[] = {{"cam", kCamera},
                                                               {"view", kCamera},
                                                               {"camera_name", kCamera},
                                                               {"frame_id", kFrame},
                                                               {"frame_index", kFrame},
                                                               {"joint_name", kJoint},
                                                               {"keypoint_name", kJoint},
                                                               {"landmark_name", kJoint},
                                                               {"landmark", kJoint},
                                                               {"joint_id", kJoint},
                                                               {"keypoint_id", kJoint},
                                                               {"landmark_id", kJoint},
                                                               {"frame_idx", kFrame},
                                                               {"frame_number", kFrame},
                                                               {"person_id", kPerson},
                                                               {"marker", kJoint},
                                                               {"keypoint", kJoint},
                                                               {"bodypart", kJoint},
                                                               {"point", kJoint},
                                                               {"x", kX},
                                                               {"y", kY},
                                                               {"u", kX},
                                                               {"v", kY},
                                                               {"likelihood", kScore},
                                                               {"confidence", kScore},
                                                               {"conf", kScore},
                                                               {"visibility", kScore}};
constexpr bool IsOptional(int column) { return column == kPerson || column == kScore; }

bool IsName(std::string_view text) { return WhyNotALabel(text).empty(); }

struct Row {
  int frame = 0, person = 0, joint = 0, line = 0;
  double time = 0;  ///< where that tells the frame
  Keypoint2d key;

  auto Key() const { return std::tie(frame, person, joint); }
};

using CameraRows = std::vector<std::vector<Row>>;  ///< in the order of the cameras' first appearance

/// Names in the order of their first appearance.
struct Numbering {
  std::vector<std::string> names;
  std::unordered_map<std::string, int> numbers;

  int Of(std::string_view name) {
    const auto [entry, is_new] = numbers.emplace(std::string(name), static_cast<int>(names.size()));
    if (is_new) names.emplace_back(name);
    return entry->second;
  }
};

class Reader {
 public:
  Reader(const std::string& path, const geometry::Skeleton* skeleton, const std::string& only_camera)
      : path_(path), skeleton_(skeleton), only_camera_(only_camera) {}

  CameraRows Read(std::vector<std::string>* skipped) {
    FilePieces pieces(path_);
    internal::Tolerant tolerant(skipped);
    CsvReader csv(path_, [&](std::string* text) { return pieces.Append(text); });
    while (csv.NextLine()) {
      line_ = csv.line_number();
      if (num_fields_ == 0) {
        ReadHeader(csv.Cells());
      } else {
        tolerant.Try([&] { AddRow(&csv); });
        if (!unknown_joint_.empty()) FailJoint();
      }
    }
    if (num_fields_ == 0) Fail("the file is empty; the first line must be camera,frame,person,joint,x_px,y_px,score");
    tolerant.Finish();
    return std::move(rows_);
  }

  bool is_timed() const { return time_column_ >= 0; }
  const std::vector<std::string>& cameras() const { return cameras_.names; }
  const std::vector<std::string>& joints() const { return joints_.names; }

 private:
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(path_, "line " + std::to_string(line_), what); }
  [[noreturn]] void FailJoint() const {
    Fail(geometry::UnknownJoint(*skeleton_, unknown_joint_) +
         "; give the skeleton that has it by option 'skeleton', or none to take the joints from the file");
  }

  void SetColumn(const std::vector<std::string_view>& fields, std::ptrdiff_t place, size_t i) {
    int& column = columns_[static_cast<size_t>(place)];
    if (column >= 0) Fail("two columns are called `" + std::string(fields[i]) + "`");
    column = static_cast<int>(i);
  }

  void ReadHeader(const std::vector<std::string_view>& fields) {
    columns_.fill(-1);
    num_fields_ = fields.size();
    std::vector<std::string> names;
    for (const std::string_view field : fields) names.push_back(internal::LowerCase(std::string(field)));
    for (size_t i = 0; i < fields.size(); ++i) {
      const auto known = std::find(std::begin(kNames), std::end(kNames), names[i]);
      if (known != std::end(kNames)) SetColumn(fields, known - std::begin(kNames), i);
    }
    for (const auto& [name, column] : kOtherNames) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (columns_[column] < 0 && found != names.end()) SetColumn(fields, column, static_cast<size_t>(found - names.begin()));
    }
    const auto time = std::find_if(fields.begin(), fields.end(), IsTimeColumn);
    if (columns_[kFrame] < 0 && time != fields.end()) time_column_ = time - fields.begin();
    for (int c = 0; c < kNumColumns; ++c) {
      if (columns_[c] >= 0 || IsOptional(c) || (c == kFrame && time_column_ >= 0)) continue;
      if (c == kCamera && !only_camera_.empty()) continue;
      Fail(std::string("there is no column `") + kNames[c] +
           "`; the first line must name camera,frame,person,joint,x_px,y_px,score");
    }
  }

  std::string_view Field(const std::vector<std::string_view>& fields, int c) const {
    return columns_[c] < 0 ? std::string_view() : fields[static_cast<size_t>(columns_[c])];
  }

  [[noreturn]] void FailNumber(const std::vector<std::string_view>& fields, int c, const char* what) const {
    const std::string_view field = Field(fields, c);
    Fail(std::string("`") + kNames[c] + "` is `" + std::string(field) + "`, " + what + DecimalCommaHint(field));
  }

  /// NaN for a missing one.
  double Number(const std::vector<std::string_view>& fields, int c) const {
    const NumberCell cell = ReadNumberCell(Field(fields, c));
    if (cell.kind == NumberCell::Kind::kOther) FailNumber(fields, c, "not a number");
    return cell.value;
  }

  int Index(const std::vector<std::string_view>& fields, int c) const {
    if (columns_[c] < 0) return 0;
    const std::optional<int> value = WholeNumberCell(Field(fields, c), std::numeric_limits<int>::max());
    if (!value) FailNumber(fields, c, "not a whole number from 0 to 2147483647");
    return *value;
  }

  int Frame(const std::vector<std::string_view>& fields) const {
    std::string why;
    const int64_t frame = ReadFrameNumber(Field(fields, kFrame), std::numeric_limits<int>::max(), &why);
    if (frame < 0) Fail("`frame` " + why);
    return static_cast<int>(frame);
  }

  int JointIndex(std::string_view name) {
    if (!skeleton_) return joints_.Of(name);
    const auto [known, is_new] = places_.emplace(std::string(name), -1);
    if (is_new) known->second = geometry::FindJoint(*skeleton_, known->first);
    if (known->second < 0) unknown_joint_ = name;
    return known->second;
  }

  void AddRow(CsvReader* csv) {
    const std::vector<std::string_view>& fields = csv->Cells();
    csv->RequireCells(num_fields_);
    Row row;
    row.line = line_;
    if (time_column_ < 0) row.frame = Frame(fields);
    row.person = Index(fields, kPerson);
    if (time_column_ >= 0) row.time = ReadNumberCell(fields[static_cast<size_t>(time_column_)]).value;
    if (!std::isfinite(row.time)) Fail("the row has no time, and no column tells its frame");
    Keypoint2d key{Number(fields, kX), Number(fields, kY)};
    key.score = columns_[kScore] < 0 ? ScoreOfUnscored(key.x_px, key.y_px) : Number(fields, kScore);
    if (std::isfinite(key.x_px + key.y_px + key.score)) row.key = key;
    const std::string_view of_camera = columns_[kCamera] < 0 ? std::string_view(only_camera_) : Field(fields, kCamera);
    for (const int c : {kCamera, kJoint}) {
      if (!IsName(c == kCamera ? of_camera : Field(fields, c)))
        Fail(std::string("`") + kNames[c] + "` is empty, not UTF-8, or has control characters in it");
    }
    const auto camera = static_cast<size_t>(cameras_.Of(of_camera));
    rows_.resize(cameras_.names.size());
    row.joint = JointIndex(Field(fields, kJoint));
    rows_[camera].push_back(row);
  }

  const std::string path_;
  const geometry::Skeleton* skeleton_;
  const std::string only_camera_;
  std::array<int, kNumColumns> columns_{};
  std::ptrdiff_t time_column_ = -1;  ///< where no column gives frames
  size_t num_fields_ = 0;
  int line_ = 0;
  std::string unknown_joint_;
  Numbering cameras_, joints_;
  CameraRows rows_;
  std::unordered_map<std::string, int> places_;  ///< in the skeleton, of the file's joints
};

std::vector<double> DistinctTimes(const std::vector<Row>& rows) {
  std::set<double> distinct;
  for (const Row& row : rows) distinct.insert(row.time);
  return {distinct.begin(), distinct.end()};
}

/// Numbers the rows of all cameras by one step, the shortest of any camera: the others may run at a part of its rate, or hold
/// every second image alone. Returns it.
double NumberByTimes(const std::string& path, const std::vector<std::string>& names, CameraRows* cameras) {
  std::string why = "no camera has rows";
  double step = INFINITY;
  for (const std::vector<Row>& rows : *cameras) {
    if (const auto found = FramesOfTimes(DistinctTimes(rows), &why)) step = std::min(step, found->step);
  }
  for (size_t c = 0; c < cameras->size(); ++c) {
    std::vector<Row>& rows = (*cameras)[c];
    const std::vector<double> times = DistinctTimes(rows);
    const auto found = std::isfinite(step) ? FramesOfTimes(times, &why, step) : std::nullopt;
    if (!found)
      throw FormatError(path, "times of camera " + names[c],
                        why + ", and there is no column `frame`: add one, with the number of the image");
    for (Row& row : rows) {
      const auto at = std::lower_bound(times.begin(), times.end(), row.time) - times.begin();
      row.frame = found->frames[static_cast<size_t>(at)];
    }
  }
  return step;
}

/// Sorts and leaves out all rows whose point another row gives, too.
void DropTwins(const std::string& path, std::vector<Row>* rows, std::vector<std::string>* skipped) {
  std::sort(rows->begin(), rows->end(), [](const Row& a, const Row& b) {
    return std::tuple_cat(a.Key(), std::tie(a.line)) < std::tuple_cat(b.Key(), std::tie(b.line));
  });
  size_t kept = 0;
  for (size_t i = 0; i < rows->size();) {
    size_t end = i + 1;
    while (end < rows->size() && (*rows)[end].Key() == (*rows)[i].Key()) ++end;
    for (size_t k = i + 1; k < end; ++k) {
      skipped->push_back(path + ": lines " + std::to_string((*rows)[i].line) + " and " + std::to_string((*rows)[k].line) +
                         ": the same camera, frame, person and joint twice; neither is used");
    }
    if (end == i + 1) (*rows)[kept++] = (*rows)[i];
    i = end;
  }
  rows->resize(kept);
}

size_t CountRows(const CameraRows& cameras) {
  size_t count = 0;
  for (const std::vector<Row>& rows : cameras) count += rows.size();
  return count;
}

/// Every person gets a place for every joint, so a small file of very many joint names would need a huge table.
void RequireDense(const std::string& path, const CameraRows& cameras, size_t num_joints) {
  constexpr size_t kFreePlaces = 20'000'000, kMaxPlacesPerRow = 1000;
  const size_t num_rows = CountRows(cameras);
  size_t people = 0;
  for (const std::vector<Row>& rows : cameras) {
    const auto who = [&](size_t k) { return std::tie(rows[k].frame, rows[k].person); };
    for (size_t i = 0; i < rows.size(); ++i) people += i == 0 || who(i) != who(i - 1);
  }
  if (people * num_joints <= std::max(kFreePlaces, kMaxPlacesPerRow * num_rows)) return;
  throw FormatError(path, "column joint",
                    std::to_string(num_joints) + " different joints for " + std::to_string(people) + " people in " +
                        std::to_string(num_rows) + " rows; is it the right column?");
}

Pose2dTrack TrackOf(const std::string& camera, const std::vector<Row>& rows, size_t num_joints) {
  Pose2dTrack track{camera, {}};
  int last_person = 0;
  for (const Row& row : rows) {
    std::vector<Person2d>& people = track.frames[row.frame];
    if (people.empty() || row.person != last_person) people.emplace_back().keypoints.resize(num_joints);
    last_person = row.person;
    people.back().keypoints[static_cast<size_t>(row.joint)] = row.key;
  }
  return track;
}

}  // namespace

Pose2dSet ReadPose2dCsv(const std::string& path, const geometry::Skeleton* skeleton, const std::string& only_camera) {
  Pose2dSet set;
  Reader reader(path, skeleton, only_camera);
  CameraRows cameras = reader.Read(&set.skipped);
  if (CountRows(cameras) == 0) throw FormatError(path, "", "the table holds no point");
  if (reader.is_timed()) set.time_step = NumberByTimes(path, reader.cameras(), &cameras);
  for (std::vector<Row>& rows : cameras) DropTwins(path, &rows, &set.skipped);
  if (CountRows(cameras) == 0) throw FormatError(path, "", "every point stands there twice");
  set.skeleton = skeleton ? *skeleton : geometry::PointsSkeleton(reader.joints());
  RequireDense(path, cameras, set.skeleton.joints.size());
  for (size_t c = 0; c < cameras.size(); ++c) {
    const std::vector<Row> rows = std::move(cameras[c]);  // one camera is held in two forms, not all
    set.tracks.push_back(TrackOf(reader.cameras()[c], rows, set.skeleton.joints.size()));
  }
  return set;
}

void WritePose2dCsv(const Pose2dSet& set, const std::string& path) {
  std::string text = "camera,frame,person,joint,x_px,y_px,score\n";
  const auto check_name = [](const std::string& name) {
    MVS_CHECK(!name.empty() && name.find_first_of(",\r\n") == std::string::npos, "name `" << name << "`");
  };
  for (const std::string& joint : set.skeleton.joints) check_name(joint);
  for (const Pose2dTrack& track : set.tracks) {
    check_name(track.camera);
    const std::string camera = CsvCell(track.camera);
    for (const auto& [frame, people] : track.frames) {
      for (size_t p = 0; p < people.size(); ++p) {
        MVS_CHECK(people[p].keypoints.size() == set.skeleton.joints.size(), people[p].keypoints.size() << " keypoints");
        for (size_t j = 0; j < people[p].keypoints.size(); ++j) {
          const Keypoint2d& key = people[p].keypoints[j];
          if (key.score == 0) continue;
          text += camera + ',' + std::to_string(frame) + ',' + std::to_string(p) + ',' + CsvCell(set.skeleton.joints[j]);
          for (const double value : {key.x_px, key.y_px, key.score}) text += ',', AppendShortestText(value, &text);
          text += '\n';
        }
      }
    }
  }
  WriteFileAtomic(path, text);
}

}  // namespace mvstudio::dataset
