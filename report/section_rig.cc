#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "report/page/format.h"
#include "report/sections.h"
#include "report/svg/rig_view.h"

namespace mvstudio::report {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr size_t kMaxCloud = 1500;
constexpr size_t kMaxPath = 600;

/// Joints by OpenPose's names that are drawn as connected; the first that exist are used.
constexpr std::pair<const char*, const char*> kBones[] = {
    {"Neck", "RShoulder"},   {"Neck", "LShoulder"}, {"RShoulder", "LShoulder"},
    {"RShoulder", "RElbow"}, {"RElbow", "RWrist"},  {"LShoulder", "LElbow"},
    {"LElbow", "LWrist"},    {"Neck", "MidHip"},    {"MidHip", "RHip"},
    {"MidHip", "LHip"},      {"RHip", "LHip"},      {"RShoulder", "RHip"},
    {"LShoulder", "LHip"},   {"RHip", "RKnee"},     {"RKnee", "RAnkle"},
    {"LHip", "LKnee"},       {"LKnee", "LAnkle"},   {"RAnkle", "RBigToe"},
    {"LAnkle", "LBigToe"},   {"RAnkle", "RHeel"},   {"LAnkle", "LHeel"},
    {"Neck", "Nose"},        {"Nose", "Head"}};

using FrameJoints = std::map<std::string, Vector3>;

/// (frame, person) -> joints with status Ok.
std::map<std::pair<int, int>, FrameJoints> ReadJoints(const TableFile& table) {
  std::map<std::pair<int, int>, FrameJoints> frames;
  const int frame = table.Column("frame"), person = table.Column("person"), joint = table.Column("joint"),
            status = table.Column("status");
  const int x = table.Column("x_m"), y = table.Column("y_m"), z = table.Column("z_m");
  if (joint < 0) return frames;
  for (size_t row = 0; row < table.rows.size(); ++row) {
    const Vector3 p = {table.Number(row, x), table.Number(row, y), table.Number(row, z)};
    const bool finite = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
    if (!finite || (status >= 0 && table.rows[row][status] != "Ok")) continue;
    const double frame_number = table.Number(row, frame), person_number = person < 0 ? 0 : table.Number(row, person);
    if (!std::isfinite(frame_number) || !std::isfinite(person_number)) continue;
    frames[{static_cast<int>(person_number), static_cast<int>(frame_number)}][table.rows[row][joint]] = p;
  }
  return frames;
}

Vector3 Mean(const FrameJoints& joints) {
  Vector3 mean{};
  for (const auto& [name, p] : joints) {
    for (int i = 0; i < 3; ++i) mean[i] += p[i] / static_cast<double>(joints.size());
  }
  return mean;
}

/// A colour such as "#ff8800", or nothing.
std::string PlainColour(const std::string& text) {
  const bool plain =
      text.size() == 7 && text[0] == '#' && text.find_first_not_of("0123456789abcdefABCDEF", 1) == std::string::npos;
  return plain ? text : "";
}

/// The bones of a pose: those of its skeleton, else people's.
std::vector<ViewBone> BonesOf(const FrameJoints& joints, const Value& skeleton) {
  std::vector<ViewBone> bones;
  for (const NamedBone& bone : NamedBones(skeleton)) {
    const auto from = joints.find(bone.from), to = joints.find(bone.to);
    if (from != joints.end() && to != joints.end()) bones.push_back({from->second, to->second, bone.colour});
  }
  return bones;
}

ViewSubject ReadSubject(const TableFile& table, const Value& skeleton) {
  ViewSubject subject;
  const auto frames = ReadJoints(table);
  size_t total = 0, index = 0;
  const FrameJoints* fullest = nullptr;
  for (const auto& [key, joints] : frames) {
    total += joints.size();
    if (!fullest || joints.size() > fullest->size()) fullest = &joints;
  }
  const size_t stride = total / kMaxCloud + 1, path_stride = frames.size() / kMaxPath + 1;
  size_t frame_index = 0;
  int last_person = frames.empty() ? 0 : frames.begin()->first.first;
  for (const auto& [key, joints] : frames) {
    for (const auto& [name, p] : joints) {
      if (index++ % stride == 0) subject.cloud.push_back(p);
    }
    if (key.first != last_person) subject.path.push_back({kNone, kNone, kNone});
    last_person = key.first;
    const auto hip = joints.find("MidHip");
    if (frame_index++ % path_stride == 0) subject.path.push_back(hip != joints.end() ? hip->second : Mean(joints));
  }
  if (!fullest) return subject;
  subject.bones = BonesOf(*fullest, skeleton);
  return subject;
}

Value Triple(const Vector3& v) { return Value::Array().Append(v[0]).Append(v[1]).Append(v[2]); }

}  // namespace

ViewCamera ReadViewCamera(const Value& camera) {
  ViewCamera view;
  view.name = camera["name"].Text("?");
  const Value& pose = camera["cam_from_world"];
  const Value& translation = pose["translation"].IsArray() ? pose["translation"] : pose["translation_m"];
  std::array<double, 4> rotation;
  for (size_t i = 0; i < 4; ++i) rotation[i] = pose["rotation_xyzw"].At(i).Number();
  SetPose(rotation, {translation.At(0).Number(), translation.At(1).Number(), translation.At(2).Number()}, &view);
  const double half_width = camera["size_px"].At(0).Number() / 2 / camera.Path("intrinsics.fx").Number();
  const double half_height = camera["size_px"].At(1).Number() / 2 / camera.Path("intrinsics.fy").Number();
  // A fisheye's image has no size at unit depth; the drawing is kept within reason.
  if (std::isfinite(half_width) && half_width > 0) view.half_width = std::min(half_width, 1.5);
  if (std::isfinite(half_height) && half_height > 0) view.half_height = std::min(half_height, 1.5);
  return view;
}

std::vector<NamedBone> NamedBones(const Value& skeleton) {
  std::vector<NamedBone> bones;
  if (!skeleton["bones"].IsArray() || skeleton["human"].Flag()) {
    for (const auto& [a, b] : kBones) bones.push_back({a, b, ""});
    return bones;
  }
  for (const Value& bone : skeleton["bones"].items()) {
    const Value& ends = bone.IsArray() ? bone : bone["joints"];
    bones.push_back({ends.At(0).Text(), ends.At(1).Text(), PlainColour(bone["colour"].Text())});
  }
  return bones;
}

std::string RigFigures(const Value& calibration, const CsvFile* points, const Value& skeleton) {
  std::vector<ViewCamera> cameras;
  for (const Value& camera : calibration["cameras"].items()) {
    ViewCamera view = ReadViewCamera(camera);
    if (std::isfinite(view.center_in_world[0] + view.center_in_world[1] + view.center_in_world[2]))
      cameras.push_back(std::move(view));
  }
  if (cameras.empty()) return {};
  const ViewSubject subject = points ? ReadSubject(points->table, skeleton) : ViewSubject{};
  const std::string people =
      subject.cloud.empty() ? ""
                            : " Green: joints of all frames; orange: path of the hips; dark: the pose with the most joints.";
  std::vector<std::string> figures = {
      FigureHtml(RigTopView(cameras, subject), "Cameras as calibrated; frusta show each image's field of view." + people),
      FigureHtml(RigCornerView(cameras, subject),
                 "The same rig from a corner; equal scale on all axes, grid on the lowest level.")};
  const std::string pose = SubjectView(cameras, subject);
  if (!pose.empty()) figures.push_back(FigureHtml(pose, "The pose with the most joints, from the same corner."));
  return GridHtml(figures, "grid three");
}

Value CalibrationSummary(const Value& calibration) {
  Value cameras = Value::Array();
  for (const Value& camera : calibration["cameras"].items()) {
    const ViewCamera view = ReadViewCamera(camera);
    const double fx = camera.Path("intrinsics.fx").Number(), fy = camera.Path("intrinsics.fy").Number();
    const Value& covariance = camera["intrinsics_covariance"];
    const double variance = (covariance.At(0).At(0).Number() + covariance.At(1).At(1).Number()) / 2;
    Value summary = Value::Object();
    summary.Set("name", view.name).Set("model", camera["model"]).Set("size_px", camera["size_px"]);
    summary.Set("focal_px", (fx + fy) / 2).Set("focal_sigma_px", std::sqrt(variance));
    summary.Set("center_in_world_m", Triple(view.center_in_world));
    cameras.Append(std::move(summary));
  }
  return cameras;
}

}  // namespace mvstudio::report
