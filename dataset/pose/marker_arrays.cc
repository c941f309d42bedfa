#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/format.h"
#include "dataset/arrays/npz.h"
#include "dataset/pose/bvh_file.h"
#include "dataset/pose/marker_formats.h"
#include "dataset/pose/marker_labels.h"

namespace mvstudio::dataset::internal {
namespace {

using Members = std::map<std::string, std::string>;

/// `joints`, else the only array of points.
NpyArray PointArray(const Members& members, const std::string& path) {
  const auto named = members.find("joints");
  if (named != members.end()) return ParseNpy(named->second, path + ": joints");
  std::vector<std::pair<std::string, NpyArray>> found;
  for (const auto& [name, bytes] : members) {
    try {
      NpyArray array = ParseNpy(bytes, path + ": " + name);
      if ((array.shape.size() == 3 || array.shape.size() == 4) && array.shape.back() == 3)
        found.emplace_back(name, std::move(array));
    } catch (const FormatError&) {  // texts and other types
    }
  }
  if (found.size() == 1) return std::move(found[0].second);
  throw FormatError(path, "",
                    found.empty() ? "holds no array `joints` (frames, people, points, 3)"
                                  : "holds several arrays of points; call one of them `joints`");
}

std::vector<int> WholeNumbers(const Members& members, const char* name, size_t count, const std::string& path) {
  std::vector<int> numbers;
  const auto found = members.find(name);
  if (found == members.end()) {
    for (size_t i = 0; i < count; ++i) numbers.push_back(static_cast<int>(i));
    return numbers;
  }
  const NpyArray array = ParseNpy(found->second, path + ": " + name);
  for (const double value : array.values) {
    if (!(std::abs(value) < 1e9) || value != std::floor(value)) throw FormatError(path, name, "holds what is no whole number");
    numbers.push_back(static_cast<int>(value));
  }
  if (numbers.size() != count)
    throw FormatError(path, name, Format("has %zu entries, `joints` has %zu", numbers.size(), count));
  return numbers;
}

std::vector<std::string> PointNames(const Members& members, size_t count, const std::string& path) {
  for (const char* name : {"joint_names", "names"}) {
    const auto found = members.find(name);
    if (found == members.end()) continue;
    std::vector<std::string> names = ParseNpyTexts(found->second, path + ": " + name);
    if (names.size() != count) throw FormatError(path, name, Format("has %zu names for %zu points", names.size(), count));
    return names;
  }
  std::vector<std::string> names;
  for (size_t i = 1; i <= count; ++i) names.push_back("point_" + std::to_string(i));
  return names;
}

/// One value; NaN: it is not there.
double ValueIn(const Members& members, const char* name, const std::string& path) {
  const auto found = members.find(name);
  if (found == members.end()) return std::nan("");
  const NpyArray array = ParseNpy(found->second, path + ": " + name);
  return array.values.size() == 1 ? array.values[0] : std::nan("");
}

std::string StatedUnit(const Members& members, const std::string& path) {
  const auto found = members.find("unit");
  if (found == members.end()) return members.count("joints") && members.count("joint_names") ? "m" : "";  // `dataset export`
  const std::vector<std::string> texts = ParseNpyTexts(found->second, path + ": unit");
  return texts.size() == 1 ? texts[0] : "";
}

/// Mean extent of the joints along the file's axes, over frames spread over the clip.
Eigen::Vector3d MeanExtent(const BvhClip& clip) {
  constexpr int kLooks = 20;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < kLooks; ++k) {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& x : PlaceJoints(clip, k * (clip.num_frames - 1) / (kLooks - 1)).place) box.extend(x);
    sum += box.sizes();
  }
  return sum;
}

/// The clip's own hierarchy, which a .bvh made of its joints gets again.
geometry::Skeleton HierarchyOfClip(const BvhClip& clip, const std::string& path, double metres) {
  geometry::Skeleton skeleton;
  skeleton.name = std::filesystem::path(path).stem().string();
  if (geometry::FindSkeleton(skeleton.name)) skeleton.name += "_bvh";
  for (size_t j = 0; j < clip.joints.size(); ++j) {
    const BvhClip::Joint& joint = clip.joints[j];
    skeleton.joints.push_back(joint.name), skeleton.parents.push_back(joint.parent);
    if (joint.parent >= 0) skeleton.bones.emplace_back(joint.parent, static_cast<int>(j));
    const Eigen::Vector3d offset = joint.parent < 0 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(metres * joint.offset);
    skeleton.rest_m.push_back({offset.x(), offset.y(), offset.z()});
  }
  return skeleton;
}

/// The joints' names, each once, as files of markers name them.
void NameJointsOnce(BvhClip* clip) {
  std::vector<std::string> labels;
  for (const BvhClip::Joint& joint : clip->joints) {
    std::string label = joint.name;
    std::replace(label.begin(), label.end(), ':', '_');  // a prefix is no subject here: mixamorig:Hips
    labels.push_back(label);
  }
  const std::vector<MarkerLabel> names = SplitLabels(labels);
  for (size_t j = 0; j < names.size(); ++j) clip->joints[j].name = names[j].name;
}

}  // namespace

MarkerFile ReadNpzMarkers(const std::string& path, const std::string& unit) {
  const Members members = dataset::ReadNpzMembers(path);
  const NpyArray points = PointArray(members, path);
  if ((points.shape.size() != 3 && points.shape.size() != 4) || points.shape.back() != 3)
    throw FormatError(path, "joints", "must have the shape (frames, points, 3) or (frames, people, points, 3)");
  MarkerFile file;
  file.pose.skeleton = "points", file.y_up = false;
  const size_t num_frames = static_cast<size_t>(points.shape[0]);
  const size_t num_people = points.shape.size() == 4 ? static_cast<size_t>(points.shape[1]) : 1;
  const size_t num_points = static_cast<size_t>(points.shape[points.shape.size() - 2]);
  const std::vector<int> frames = WholeNumbers(members, "frames", num_frames, path);
  const std::vector<int> people = WholeNumbers(members, "people", num_people, path);
  const std::vector<std::string> names = PointNames(members, num_points, path);
  const auto sigmas = members.find("sigma_m");
  const NpyArray sigma = sigmas == members.end() ? NpyArray() : ParseNpy(sigmas->second, path + ": sigma_m");
  const auto marks = members.find("filled");
  const NpyArray filled = marks == members.end() ? NpyArray() : ParseNpy(marks->second, path + ": filled");
  file.unit = UnitOrAsk(unit, StatedUnit(members, path), path);
  const double metres = MetresPerUnit(file.unit).value_or(1);
  for (size_t i = 0; i < num_frames * num_people * num_points; ++i) {
    const Eigen::Vector3d x =
        metres * Eigen::Vector3d(points.values[3 * i], points.values[3 * i + 1], points.values[3 * i + 2]);
    AddMarkerRow(frames[i / (num_people * num_points)], people[i / num_points % num_people], names[i % num_points], x,
                 &file.pose);
    JointRow& row = file.pose.rows.back();
    if (row.status != Status::kOk) continue;
    if (i < sigma.values.size() && std::isfinite(sigma.values[i])) row.sigma_m = sigma.values[i];
    if (i < filled.values.size()) row.num_views = filled.values[i] != 0 ? 0 : 1;
  }
  const double rate_hz = ValueIn(members, "rate_hz", path);
  file.pose.frame_rate_hz = rate_hz > 0 && std::isfinite(rate_hz) ? rate_hz : 0;
  if (file.pose.rows.empty()) throw FormatError(path, "joints", "is empty");
  for (const char* key : {"up", "axes", "up_axis", "scale", "coordinate_system"}) {
    if (members.count(key) > 0)
      file.notes.push_back("its array `" + std::string(key) + "` is not read: option 'up' and option 'unit' say what is meant");
  }
  SortByFrame(path, &file.pose);
  return file;
}

MarkerFile ReadBvhMarkers(const std::string& path, const std::string& unit) {
  BvhClip clip = ReadBvh(path);
  NameJointsOnce(&clip);
  MarkerFile file;
  file.pose.skeleton = "points", file.y_up = true;
  file.unit = unit.empty() ? "cm" : unit;
  if (unit.empty()) file.notes.push_back("a .bvh names no unit; its lengths are taken as cm");
  const double metres = MetresPerUnit(file.unit).value_or(1);
  file.pose.definition = HierarchyOfClip(clip, path, metres);
  file.pose.skeleton = file.pose.definition->name;
  for (int f = 0; f < clip.num_frames; ++f) {
    const BvhPlacement placement = PlaceJoints(clip, f);
    for (size_t j = 0; j < clip.joints.size(); ++j) {
      const Eigen::Vector3d& x = placement.place[j];
      AddMarkerRow(f, 0, clip.joints[j].name, metres * Eigen::Vector3d(x.x(), -x.z(), x.y()), &file.pose);
    }
  }
  const double rate_hz = 1 / clip.frame_time_s, whole = std::round(rate_hz);
  // Frame times are written with few digits: 0.0333333, .03333, 0.008342.
  file.pose.frame_rate_hz = whole > 0 && std::abs(rate_hz - whole) < 2e-4 * whole ? whole : rate_hz;
  const Eigen::Vector3d extent = MeanExtent(clip);
  if (extent.z() > 1.5 * extent.y())
    file.notes.push_back("its joints reach farther along z than along y: option 'up' z if z is up in it");
  return file;
}

}  // namespace mvstudio::dataset::internal
