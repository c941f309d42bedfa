#include <Eigen/Geometry>
#include <cmath>
#include <cstring>

#include "dataset/arrays/glb.h"
#include "dataset/exports/frustum.h"
#include "dataset/exports/joint_files.h"
#include "geometry/skeleton/skeleton.h"

/// glTF 2.0, binary (https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html): metres, y up; cameras look along -z with y up.
namespace mvstudio::exports {
namespace {

using dataset::internal::AppendTurn;
using dataset::internal::AppendVector;
using dataset::internal::GlbBuilder;
using dataset::internal::kArrayBuffer;
using dataset::internal::kElementBuffer;
using Json = dataset::internal::GlbJson;

constexpr int kLines = 1;
constexpr double kJointRadiusM = 0.025, kBoneRadiusM = 0.02;

Json List3(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

std::vector<float> Packed(const std::vector<Eigen::Vector3d>& points) {
  std::vector<float> values;
  for (const Eigen::Vector3d& p : points) AppendVector(&values, p);
  return values;
}

int Material(GlbBuilder* builder, const std::string& name, const std::vector<double>& rgba) {
  return builder->Add("materials",
                      {{"name", name},
                       {"pbrMetallicRoughness", {{"baseColorFactor", rgba}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.9}}},
                       {"doubleSided", true}});
}

int TriangleMesh(GlbBuilder* builder, const std::string& name, const std::vector<Eigen::Vector3d>& points,
                 const std::vector<uint16_t>& triangles, int material) {
  Json primitive = {{"attributes", {{"POSITION", builder->Floats(Packed(points), 3, kArrayBuffer)}}},
                    {"indices", builder->Shorts(triangles, 1, kElementBuffer)},
                    {"material", material}};
  return builder->Add("meshes", {{"name", name}, {"primitives", Json::array({primitive})}});
}

/// An octahedron about the origin.
int JointMesh(GlbBuilder* builder, int material) {
  return TriangleMesh(builder, "joint", {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
                      {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5}, material);
}

/// Two pyramids base to base, from the origin to (0, 0, 1).
int BoneMesh(GlbBuilder* builder, int material) {
  constexpr double kWaist = 0.2;
  return TriangleMesh(builder, "bone", {{0, 0, 0}, {1, 0, kWaist}, {0, 1, kWaist}, {-1, 0, kWaist}, {0, -1, kWaist}, {0, 0, 1}},
                      {0, 2, 1, 0, 3, 2, 0, 4, 3, 0, 1, 4, 5, 1, 2, 5, 2, 3, 5, 3, 4, 5, 4, 1}, material);
}

int FrustumMesh(GlbBuilder* builder, const View& view, int material) {
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d& x : FrustumInCam(view.camera.camera)) points.emplace_back(x.x(), -x.y(), -x.z());
  std::vector<uint16_t> lines;
  for (const auto& edge : kFrustumEdges) {
    lines.insert(lines.end(), {static_cast<uint16_t>(edge[0]), static_cast<uint16_t>(edge[1])});
  }
  Json primitive = {{"attributes", {{"POSITION", builder->Floats(Packed(points), 3, kArrayBuffer)}}},
                    {"indices", builder->Shorts(lines, 1, kElementBuffer)},
                    {"mode", kLines},
                    {"material", material}};
  return builder->Add("meshes", {{"name", "frustum " + view.info.name}, {"primitives", Json::array({primitive})}});
}

/// The camera as glTF has it (no principal point, no distortion), with all of the lens beside it in `extras`.
int CameraNode(GlbBuilder* builder, const View& view, int material) {
  const geometry::Camera& lens = view.camera.camera;
  const double half_height = lens.height_px / (2 * lens.fy()), half_width = lens.width_px / (2 * lens.fx());
  const int camera = builder->Add(
      "cameras",
      {{"type", "perspective"},
       {"name", view.info.name},
       {"perspective", {{"yfov", 2 * std::atan(half_height)}, {"aspectRatio", half_width / half_height}, {"znear", 0.05}}}});
  const geometry::Rigid3 world_from_cam = Inverse(view.camera.cam_from_world);
  const Eigen::Quaterniond q = world_from_cam.rotation * Eigen::Quaterniond(0, 1, 0, 0);  // y up, looking along -z
  Json params = Json::array();
  for (const double value : lens.params) params.push_back(value);
  Json extras = {{"lens_model", std::string(ToString(lens.model))},
                 {"lens_params", params},
                 {"width_px", lens.width_px},
                 {"height_px", lens.height_px},
                 {"dataset_name", view.info.source}};
  if (lens.model == geometry::LensModel::kSplined) {
    const geometry::SplineGrid& grid = lens.spline;
    extras["lens_spline"] = {{"order", grid.order}, {"cols", grid.cols}, {"rows", grid.rows}, {"fov_x_deg", grid.fov_x_deg}};
  }
  return builder->Add("nodes", {{"name", view.info.name},
                                {"camera", camera},
                                {"mesh", FrustumMesh(builder, view, material)},
                                {"rotation", {q.x(), q.y(), q.z(), q.w()}},
                                {"translation", List3(world_from_cam.translation)},
                                {"extras", extras}});
}

/// Values of one node over the frames.
struct Track {
  std::vector<float> translation, rotation, scale;
};

Track JointTrack(const Take& take, int person, int joint, const Eigen::Vector3d& centre) {
  Track track;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  for (const int frame : take.frames) {
    const dataset::Coco19Pose* pose = PoseOf(take, frame, person);
    const bool valid = pose && pose->valid[joint];
    if (valid) place = pose->x_in_world.col(joint) - centre;
    AppendVector(&track.translation, place);
    AppendVector(&track.scale, Eigen::Vector3d::Constant(valid ? kJointRadiusM : 0));
  }
  return track;
}

Track BoneTrack(const Take& take, int person, int from, int to, const Eigen::Vector3d& centre) {
  Track track;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  for (const int frame : take.frames) {
    const dataset::Coco19Pose* pose = PoseOf(take, frame, person);
    const bool valid = pose && pose->valid[from] && pose->valid[to];
    double length = 0;
    if (valid) {
      const Eigen::Vector3d along = pose->x_in_world.col(to) - pose->x_in_world.col(from);
      place = pose->x_in_world.col(from) - centre;
      length = along.norm();
      if (length > 0) turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), along);
    }
    AppendVector(&track.translation, place);
    AppendTurn(&track.rotation, turn);
    AppendVector(&track.scale, valid ? Eigen::Vector3d(kBoneRadiusM, kBoneRadiusM, length) : Eigen::Vector3d::Zero());
  }
  return track;
}

/// A node that follows the track; its channels join `animation`.
int AnimatedNode(GlbBuilder* builder, Json node, const Track& track, int times, Json* animation) {
  for (const auto& [key, values] : {std::pair<const char*, const std::vector<float>*>{"translation", &track.translation},
                                    {"rotation", &track.rotation},
                                    {"scale", &track.scale}}) {
    const size_t components = std::strcmp(key, "rotation") == 0 ? 4 : 3;
    if (!values->empty()) node[key] = std::vector<float>(values->begin(), values->begin() + static_cast<long>(components));
  }
  const int index = builder->Add("nodes", std::move(node));
  const auto channel = [&](const char* path, const std::vector<float>& values, size_t components, const char* interpolation) {
    if (values.empty() || !animation) return;
    const size_t sampler = (*animation)["samplers"].size();
    (*animation)["samplers"].push_back(
        {{"input", times}, {"output", builder->Floats(values, components)}, {"interpolation", interpolation}});
    (*animation)["channels"].push_back({{"sampler", sampler}, {"target", {{"node", index}, {"path", path}}}});
  };
  channel("translation", track.translation, 3, "LINEAR");
  channel("rotation", track.rotation, 4, "LINEAR");
  channel("scale", track.scale, 3, "STEP");
  return index;
}

/// Middle of all joints: what is animated in single precision counts from here.
Eigen::Vector3d Centre(const Take& take) {
  Eigen::AlignedBox3d box;
  for (const int frame : take.frames) {
    for (const auto& [id, pose] : take.At(frame)) {
      for (int j = 0; j < 19; ++j) {
        if (pose.valid[j]) box.extend(Eigen::Vector3d(pose.x_in_world.col(j)));
      }
    }
  }
  return box.isEmpty() ? Eigen::Vector3d(0, 0, 0) : Eigen::Vector3d(box.center());
}

Json PersonNodes(GlbBuilder* builder, const Take& take, int person, const Eigen::Vector3d& centre, int times, int material,
                 Json* animation) {
  const int joint_mesh = JointMesh(builder, material), bone_mesh = BoneMesh(builder, material);
  const std::string prefix = "person" + std::to_string(person) + " ";
  const std::vector<std::string>& joints = geometry::Coco19().joints;
  Json children = Json::array();
  for (int j = 0; j < 19; ++j) {
    const Json node = {{"name", prefix + joints[static_cast<size_t>(j)]}, {"mesh", joint_mesh}};
    children.push_back(AnimatedNode(builder, node, JointTrack(take, person, j, centre), times, animation));
  }
  for (const auto& [a, b] : geometry::Coco19().bones) {
    const Json node = {{"name", prefix + joints[static_cast<size_t>(a)] + "-" + joints[static_cast<size_t>(b)]},
                       {"mesh", bone_mesh}};
    children.push_back(AnimatedNode(builder, node, BoneTrack(take, person, a, b, centre), times, animation));
  }
  return children;
}

void AddPeople(GlbBuilder* builder, const Take& take, Json* world_children) {
  const std::vector<int> people = take.PersonIds();
  if (people.empty()) return;
  const std::vector<std::vector<double>> colours = {
      {0.9, 0.3, 0.2, 1}, {0.2, 0.5, 0.9, 1}, {0.2, 0.7, 0.35, 1}, {0.9, 0.7, 0.15, 1}};
  const Eigen::Vector3d centre = Centre(take);
  std::vector<float> seconds;
  for (const int frame : take.frames) {
    seconds.push_back(static_cast<float>((frame - take.frames.front()) / take.frame_rate_hz));
  }
  Json animation = {{"name", "take"}, {"samplers", Json::array()}, {"channels", Json::array()}};
  const int times = builder->Floats(seconds, 1);
  Json children = Json::array();
  for (size_t p = 0; p < people.size(); ++p) {
    const int material = Material(builder, "person" + std::to_string(people[p]), colours[p % colours.size()]);
    for (const Json& node : PersonNodes(builder, take, people[p], centre, times, material, &animation))
      children.push_back(node);
  }
  world_children->push_back(
      builder->Add("nodes", {{"name", "people"}, {"translation", List3(centre)}, {"children", children}}));
  builder->Set("animations", Json::array({animation}));
}

}  // namespace

void WriteGltf(const Job& job) {
  NoteJointsBeside(job);
  GlbBuilder builder;
  Json children = Json::array();
  const int material = Material(&builder, "cameras", {0.15, 0.15, 0.15, 1});
  for (const View& view : job.take.views) children.push_back(CameraNode(&builder, view, material));
  AddPeople(&builder, job.take, &children);
  // y up = our z, exactly.
  const int world = builder.Add(
      "nodes",
      {{"name", "world, z up"}, {"matrix", {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1}}, {"children", children}});
  builder.Set("scene", 0);
  builder.Set("scenes", Json::array({{{"nodes", {world}}}}));
  job.Write(job.take.sequence + ".glb", builder.Glb());
}

}  // namespace mvstudio::exports
