#include "dataset/pose/pose3d.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "core/check.h"
#include "core/csv.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/label.h"
#include "core/some_of.h"
#include "core/text/shortest_text.h"
#include "dataset/json/json_file.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset {
namespace {

constexpr char kPointsHeader[] = "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m";
constexpr char kCovarianceHeader[] = "frame,person,joint,xx,xy,xz,yy,yz,zz";
constexpr char kSchema[] = "mvstudio.pose3d/1";

std::string InFolder(const std::string& folder, const char* name) { return (std::filesystem::path(folder) / name).string(); }

/// Shortest text that reads back as the same double; empty for NaN and infinity.
void AppendNumber(std::string* text, double value) {
  if (std::isfinite(value)) AppendShortestText(value, text);
}

void AppendKey(std::string* text, const JointRow& row) {
  *text += std::to_string(row.frame) + ',' + std::to_string(row.person) + ',' + CsvCell(row.joint) + ',';
}

std::string PointsText(const std::vector<JointRow>& rows) {
  std::string text;
  for (const JointRow& row : rows) {
    const bool ok = row.status == Status::kOk;
    MVS_CHECK(!ok || row.x_in_world.allFinite(), "frame " << row.frame << " " << row.joint << " is Ok and not finite");
    AppendKey(&text, row);
    text += ToString(row.status);
    for (int k = 0; k < 3; ++k) {
      text += ',';
      if (ok) AppendNumber(&text, row.x_in_world[k]);
    }
    text += ',' + std::to_string(row.num_views) + ',';
    AppendNumber(&text, row.rms_px);
    text += ',';
    AppendNumber(&text, row.sigma_m);
    text += '\n';
  }
  return text;
}

std::string CovarianceText(const std::vector<JointRow>& rows) {
  std::string text;
  for (const JointRow& row : rows) {
    if (!row.covariance) continue;
    AppendKey(&text, row);
    const Eigen::Matrix3d& c = *row.covariance;
    const double entries[] = {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)};
    for (int k = 0; k < 6; ++k) {
      if (k > 0) text += ',';
      AppendNumber(&text, entries[k]);
    }
    text += '\n';
  }
  return text;
}

/// A table with a fixed header.
class Table {
 public:
  Table(const std::string& path, const char* header) : text_(ReadFile(path)), csv_(path, text_) {
    if (!csv_.NextLine() || csv_.line() != header) {
      throw FormatError(path, "line 1", "the first line is not `" + std::string(header) + "`");
    }
    num_columns_ = csv_.Cells().size();
  }
  Table(const Table&) = delete;  // csv_ looks into text_

  /// Splits the next line; false at the end.
  bool Next() {
    if (!csv_.NextLine()) return false;
    cells_ = &csv_.Cells();
    csv_.RequireCells(num_columns_);
    return true;
  }

  std::string Text(size_t column) const { return std::string((*cells_)[column]); }

  template <class T>
  T Number(size_t column) const {
    const std::string_view cell = (*cells_)[column];
    T value{};
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (error != std::errc() || end != cell.data() + cell.size()) {
      Fail("column " + std::to_string(column + 1) + " holds `" + std::string(cell) + "`, " + WhyNoNumber(cell));
    }
    return value;
  }

  /// Time steps before the first frame of a timeline's reference are negative.
  int Frame() const {
    std::string_view cell = (*cells_)[0];
    int step = 0;
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), step);
    if (error == std::errc() && end == cell.data() + cell.size() && step < 0) return step;
    std::string why;
    const int64_t frame = ReadFrameNumber((*cells_)[0], std::numeric_limits<int>::max(), &why);
    if (frame < 0) Fail("the frame " + why);
    return static_cast<int>(frame);
  }

  double NumberOr0(size_t column) const { return (*cells_)[column].empty() ? 0.0 : Number<double>(column); }
  [[noreturn]] void Fail(const std::string& what) const { csv_.Fail(what); }

 private:
  std::string text_;
  CsvReader csv_;
  size_t num_columns_ = 0;
  const std::vector<std::string_view>* cells_ = nullptr;
};

JointRow ReadPointsRow(const Table& csv) {
  JointRow row;
  row.frame = csv.Frame();
  row.person = csv.Number<int>(1);
  row.joint = csv.Text(2);
  const std::optional<Status> status = StatusFromString(csv.Text(3));
  if (!status) csv.Fail("unknown status `" + csv.Text(3) + "`");
  row.status = *status;
  if (row.status == Status::kOk) {
    for (size_t k = 0; k < 3; ++k) row.x_in_world[static_cast<Eigen::Index>(k)] = csv.Number<double>(4 + k);
    if (!row.x_in_world.allFinite()) csv.Fail("the point is Ok and not finite");
  }
  row.num_views = csv.Number<int>(7);
  row.rms_px = csv.NumberOr0(8);
  row.sigma_m = csv.NumberOr0(9);
  return row;
}

using RowKey = std::tuple<int, int, std::string>;

std::map<RowKey, Eigen::Matrix3d> ReadCovariances(const std::string& path) {
  std::map<RowKey, Eigen::Matrix3d> covariances;
  Table csv(path, kCovarianceHeader);
  while (csv.Next()) {
    Eigen::Matrix3d& c = covariances[{csv.Frame(), csv.Number<int>(1), csv.Text(2)}];
    size_t column = 3;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) c(i, j) = c(j, i) = csv.Number<double>(column++);
    }
    if (!c.allFinite()) csv.Fail("the covariance is not finite");
  }
  return covariances;
}

void ReadHead(const std::string& path, Pose3d* pose) {
  const internal::Json root = internal::ParseJsonFile(path);
  const internal::JsonView view(path, root);
  if (view["schema"].Text() != kSchema) view["schema"].Fail(std::string("must be ") + kSchema);
  pose->skeleton = view["skeleton"].Text();
  if (view.Has("world")) pose->world = view["world"].Text();
  if (view.Has("covariance_note")) pose->covariance_note = view["covariance_note"].Text();
  if (view.Has("frame_rate_hz")) {
    pose->frame_rate_hz = view["frame_rate_hz"].Number();
    if (!(pose->frame_rate_hz > 0)) view["frame_rate_hz"].Fail("must be positive");
  }
  if (view.Has("definition")) {
    pose->definition = geometry::SkeletonFromJson(view["definition"].value().dump(), path, "definition");
  }
}

/// What later commands need not be told again; null for points without bones, and for names that no file may hold.
const geometry::Skeleton* DefinitionOf(const Pose3d& pose) {
  if (!pose.definition) return geometry::FindSkeleton(pose.skeleton);
  const std::vector<std::string>& joints = pose.definition->joints;
  const auto fits = [](const std::string& joint) { return WhyNotALabel(joint).empty(); };
  const bool writable = !pose.definition->bones.empty() && joints.size() <= geometry::kMaxSkeletonJoints &&
                        std::all_of(joints.begin(), joints.end(), fits);
  return writable ? &*pose.definition : nullptr;
}

/// Mean of the source joints; false when one of them is missing.
bool MeanJoint(const std::vector<const JointRow*>& joints, const std::vector<int>& sources, Eigen::Vector3d* mean,
               double* sigma_m) {
  if (sources.empty()) return false;
  double variance = 0;
  mean->setZero();
  for (const int source : sources) {
    const JointRow* row = joints[source];
    if (!row || row->status != Status::kOk) return false;
    *mean += row->x_in_world;
    variance += row->sigma_m * row->sigma_m;
  }
  *mean /= static_cast<double>(sources.size());
  *sigma_m = std::sqrt(variance) / static_cast<double>(sources.size());
  return true;
}

}  // namespace

bool WritePose3d(const Pose3d& pose, const std::string& folder) {
  constexpr std::ptrdiff_t kRowsAtOnce = 20'000;  // their text is held
  auto begin = pose.rows.begin();
  return WritePose3d(
      pose,
      [&](std::vector<JointRow>* rows) {
        const auto end = begin + std::min(kRowsAtOnce, pose.rows.end() - begin);
        rows->assign(begin, end);
        return std::exchange(begin, end) != end;
      },
      folder);
}

bool WritePose3d(const Pose3d& head, const std::function<bool(std::vector<JointRow>*)>& next, const std::string& folder) {
  AtomicFile points(InFolder(folder, "points.csv")), covariance(InFolder(folder, "covariance.csv")),
      json(InFolder(folder, "pose3d.json"));
  WriteFile(points.temporary(), std::string(kPointsHeader) + '\n');
  WriteFile(covariance.temporary(), std::string(kCovarianceHeader) + '\n');
  std::vector<JointRow> rows;
  bool any = false;
  while (next(&rows)) {
    any = any || std::any_of(rows.begin(), rows.end(), [](const JointRow& row) { return row.status == Status::kOk; });
    AppendToFile(points.temporary(), PointsText(rows));
    AppendToFile(covariance.temporary(), CovarianceText(rows));
  }
  if (!any && std::filesystem::exists(points.path())) return false;
  nlohmann::ordered_json header = {
      {"schema", kSchema}, {"skeleton", head.skeleton}, {"points", "points.csv"}, {"covariance", "covariance.csv"},
      {"unit", "m"},       {"world", head.world}};
  if (!head.covariance_note.empty()) header["covariance_note"] = head.covariance_note;
  if (head.frame_rate_hz > 0) header["frame_rate_hz"] = head.frame_rate_hz;
  if (const geometry::Skeleton* skeleton = DefinitionOf(head)) {
    header["definition"] = nlohmann::ordered_json::parse(geometry::SkeletonToJson(*skeleton));
  }
  WriteFile(json.temporary(), header.dump(1) + "\n");
  CommitTogether({&points, &covariance, &json});
  return true;
}

std::vector<JointRow> ReadPointsCsv(const std::string& path) {
  std::vector<JointRow> rows;
  Table csv(path, kPointsHeader);
  while (csv.Next()) rows.push_back(ReadPointsRow(csv));
  return rows;
}

Pose3d ReadPose3d(const std::string& folder) {
  Pose3d pose;
  ReadHead(InFolder(folder, "pose3d.json"), &pose);
  pose.rows = ReadPointsCsv(InFolder(folder, "points.csv"));
  const std::string covariance_path = InFolder(folder, "covariance.csv");
  if (!std::filesystem::exists(covariance_path)) return pose;
  const auto covariances = ReadCovariances(covariance_path);
  for (JointRow& row : pose.rows) {
    const auto it = covariances.find({row.frame, row.person, row.joint});
    if (it != covariances.end()) row.covariance = it->second;
  }
  return pose;
}

namespace {

/// By order of first appearance.
std::vector<std::string> JointsIn(const std::vector<JointRow>& rows) {
  std::vector<std::string> joints;
  std::set<std::string> seen;
  for (const JointRow& row : rows) {
    if (seen.insert(row.joint).second) joints.push_back(row.joint);
  }
  return joints;
}

double ConfidenceOf(double sigma_m) {
  constexpr double kConfidenceScale = 0.05;  // metres
  return std::exp(-sigma_m / kConfidenceScale);
}

}  // namespace

geometry::Skeleton SkeletonOf(const Pose3d& pose) {
  const std::vector<std::string> joints = JointsIn(pose.rows);
  if (pose.definition && HasJoints(*pose.definition, joints)) return *pose.definition;
  return geometry::SkeletonOrPoints(pose.skeleton, joints);
}

void UseSkeleton(const geometry::Skeleton& skeleton, const std::string& path, Pose3d* pose) {
  std::vector<std::string> strangers;
  std::map<std::string, std::string> names;
  const std::vector<std::string> joints = JointsIn(pose->rows);
  for (const std::string& joint : joints) {
    const int place = geometry::FindJoint(skeleton, joint);
    if (place < 0)
      strangers.push_back(joint);
    else
      names[joint] = skeleton.joints[static_cast<size_t>(place)];
  }
  if (!strangers.empty()) {
    throw FormatError(path, "",
                      "skeleton " + skeleton.name + " lacks " + std::to_string(strangers.size()) +
                          " of its joints: " + SomeOf(strangers) + "; the skeleton has " + SomeOf(skeleton.joints));
  }
  const std::string twice = geometry::TwiceTheSameJoint(skeleton, joints);
  if (!twice.empty()) throw FormatError(path, "", twice + " are the same joint of skeleton " + skeleton.name);
  for (JointRow& row : pose->rows) row.joint = names[row.joint];
  pose->skeleton = skeleton.name, pose->definition = skeleton;
}

std::map<int, std::map<int, JointsPose>> ToJoints(const Pose3d& pose, const geometry::Skeleton& skeleton) {
  const size_t count = skeleton.joints.size();
  std::map<std::string, int> index;
  for (size_t j = 0; j < count; ++j) index[skeleton.joints[j]] = static_cast<int>(j);
  std::map<int, std::map<int, JointsPose>> all;
  for (const JointRow& row : pose.rows) {
    JointsPose& joints = all[row.frame][row.person];
    if (joints.valid.empty()) {
      joints.x_in_world = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(count));
      joints.valid.assign(count, false), joints.confidence.assign(count, 0);
    }
    const auto found = index.find(row.joint);
    if (found == index.end() || row.status != Status::kOk) continue;
    joints.x_in_world.col(found->second) = row.x_in_world;
    joints.valid[static_cast<size_t>(found->second)] = true;
    joints.confidence[static_cast<size_t>(found->second)] = ConfidenceOf(row.sigma_m);
  }
  return all;
}

std::vector<std::string> JointsBeyondCoco19(const Pose3d& pose) {
  const geometry::Skeleton skeleton = SkeletonOf(pose);
  std::vector<char> used(skeleton.joints.size(), 0), seen(skeleton.joints.size(), 0);
  for (const std::vector<int>& sources : geometry::Coco19From(skeleton)) {
    for (const int joint : sources) used[static_cast<size_t>(joint)] = 1;
  }
  for (const JointRow& row : pose.rows) {
    const int joint = row.status == Status::kOk ? skeleton.Find(row.joint) : -1;
    if (joint >= 0) seen[static_cast<size_t>(joint)] = 1;
  }
  std::vector<std::string> beyond;
  for (size_t j = 0; j < skeleton.joints.size(); ++j) {
    if (seen[j] && !used[j]) beyond.push_back(skeleton.joints[j]);
  }
  return beyond;
}

std::map<int, std::map<int, Coco19Pose>> ToCoco19(const Pose3d& pose) {
  const geometry::Skeleton skeleton = SkeletonOf(pose);
  const auto sources = geometry::Coco19From(skeleton);
  std::map<std::pair<int, int>, std::vector<const JointRow*>> people;
  for (const JointRow& row : pose.rows) {
    auto& joints = people[{row.frame, row.person}];
    joints.resize(skeleton.joints.size(), nullptr);
    const int joint = skeleton.Find(row.joint);
    if (joint >= 0) joints[joint] = &row;
  }
  std::map<int, std::map<int, Coco19Pose>> result;
  for (const auto& [key, joints] : people) {
    Coco19Pose& out = result[key.first][key.second];
    for (int k = 0; k < 19; ++k) {
      Eigen::Vector3d mean;
      double sigma_m = 0;
      if (!MeanJoint(joints, sources[k], &mean, &sigma_m)) continue;
      out.valid[k] = true;
      out.x_in_world.col(k) = mean;
      out.confidence[k] = ConfidenceOf(sigma_m);
    }
  }
  return result;
}

}  // namespace mvstudio::dataset
