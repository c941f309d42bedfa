#include "synth/cloth/surface_truth.h"

#include <cmath>
#include <numeric>
#include <utility>

#include "core/disk/files.h"
#include "core/disk/npy_write.h"
#include "core/format.h"

namespace mvstudio::synth {
namespace {

using Members = std::vector<std::pair<std::string, std::string>>;

template <class Matrix>
std::string FloatRows(const Matrix& columns) {
  const Eigen::MatrixXf values = columns.template cast<float>();
  return NpyOfFloats({static_cast<size_t>(values.cols()), static_cast<size_t>(values.rows())},
                     std::vector<float>(values.data(), values.data() + values.size()));
}

std::string Ints(const std::vector<int64_t>& values) { return NpyOfInts({values.size()}, values); }

/// All weights of vertices [first, first + count): (count, B).
std::string DenseWeights(const body::BodyTemplate& body, int first, int count) {
  Eigen::MatrixXf weights = Eigen::MatrixXf::Zero(static_cast<Eigen::Index>(body.bone_names.size()), count);
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < 4; ++k) weights(body.skin_bones(k, first + i), i) += body.skin_weights(k, first + i);
  }
  return FloatRows(weights);
}

}  // namespace

SurfaceTruth::SurfaceTruth(std::string folder, const body::BodyTemplate& surface, const DressedBody* dressed)
    : folder_(std::move(folder)), surface_(surface), dressed_(dressed) {
  MakeFolder(folder_);
  const int vertices = static_cast<int>(surface.vertices.cols()), faces = static_cast<int>(surface.faces.cols());
  meshes_.push_back({"body", 0, dressed ? dressed->body_vertices : vertices, 0, dressed ? dressed->body_faces : faces});
  if (!dressed) return;
  for (const Garment& g : dressed->garments) {
    const int first_face = meshes_.back().first_face + meshes_.back().faces;
    meshes_.push_back({g.name, g.first, g.vertices(), first_face, 2 * (g.rows - 1) * g.columns});
  }
}

void SurfaceTruth::Add(int frame_idx, const body::BodyPose& pose, const Eigen::Matrix3Xf& vertices,
                       const Eigen::Matrix3Xf& skinned, const Eigen::Matrix3Xd& joints_in_world) {
  Members members;
  for (Mesh& mesh : meshes_) {
    members.emplace_back(mesh.name, FloatRows(vertices.middleCols(mesh.first, mesh.vertices)));
    if (skinned.size() == 0) continue;
    const Eigen::Matrix3Xf beyond = 1000 * (vertices - skinned).middleCols(mesh.first, mesh.vertices);
    mesh.square_sum_mm2 += beyond.cast<double>().squaredNorm();
    mesh.max_mm = std::max<double>(mesh.max_mm, beyond.colwise().norm().maxCoeff());
  }
  WriteFileAtomic(folder_ + Format("/vertices_%08d.npz", frame_idx), NpzOf(members));
  for (const geometry::Rigid3& bone : pose.bone_transforms) {
    const Eigen::Matrix3d rotation = bone.rotation.toRotationMatrix();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) transforms_.push_back(rotation(r, c));
      transforms_.push_back(bone.translation[r]);
    }
  }
  joints_.insert(joints_.end(), joints_in_world.data(), joints_in_world.data() + joints_in_world.size());
  ++frames_;
}

void SurfaceTruth::Finish(const geometry::Skeleton& skeleton, double fps) const {
  Members rest;
  std::vector<std::string> names;
  for (const Mesh& mesh : meshes_) {
    names.push_back(mesh.name);
    rest.emplace_back(mesh.name + "_v", FloatRows(surface_.vertices.middleCols(mesh.first, mesh.vertices)));
    rest.emplace_back(mesh.name + "_uv", FloatRows(surface_.face_uv.middleCols(3 * static_cast<Eigen::Index>(mesh.first_face),
                                                                               3 * static_cast<Eigen::Index>(mesh.faces))));
    rest.emplace_back(mesh.name + "_face_size", Ints(std::vector<int64_t>(mesh.faces, 3)));
    std::vector<int64_t> corners, uv(3 * static_cast<size_t>(mesh.faces)), parts, covered;
    for (int f = mesh.first_face; f < mesh.first_face + mesh.faces; ++f) {
      for (int k = 0; k < 3; ++k) corners.push_back(surface_.faces(k, f) - mesh.first);
      parts.push_back(surface_.face_part[f]);
    }
    std::iota(uv.begin(), uv.end(), 0);
    for (int i = mesh.first; i < mesh.first + mesh.vertices; ++i) covered.push_back(dressed_ ? dressed_->covered[i] : 0);
    rest.emplace_back(mesh.name + "_face_v", Ints(corners));
    rest.emplace_back(mesh.name + "_face_uv", Ints(uv));
    rest.emplace_back(mesh.name + "_face_part", Ints(parts));
    rest.emplace_back(mesh.name + "_covered", Ints(covered));
    rest.emplace_back(mesh.name + "_weights", DenseWeights(surface_, mesh.first, mesh.vertices));
  }
  rest.emplace_back("names", NpyOfTexts(names));
  WriteFileAtomic(folder_ + "/subject_rest.npz", NpzOf(rest));
  std::vector<int64_t> parents(surface_.bone_parents.begin(), surface_.bone_parents.end()), roles;
  for (const body::BoneRole role : surface_.bone_roles) roles.push_back(static_cast<int64_t>(role));
  const size_t bones = parents.size(), joints = skeleton.joints.size();
  WriteFileAtomic(folder_ + "/motion.npz", NpzOf({{"transforms", NpyOfDoubles({frames_, bones, 3, 4}, transforms_)},
                                                  {"bones", NpyOfTexts(surface_.bone_names)},
                                                  {"roles", Ints(roles)},
                                                  {"parent", Ints(parents)},
                                                  {"rest_head", FloatRows(surface_.bone_heads)},
                                                  {"joints25", NpyOfDoubles({frames_, joints, 3}, joints_)},
                                                  {"joints25_names", NpyOfTexts(skeleton.joints)},
                                                  {"fps", NpyOfDoubles({}, {fps})}}));
}

std::vector<BeyondSkinning> SurfaceTruth::beyond_skinning() const {
  std::vector<BeyondSkinning> all;
  for (const Mesh& mesh : meshes_) {
    const double samples = static_cast<double>(frames_) * mesh.vertices;
    all.push_back({mesh.name, samples > 0 ? std::sqrt(mesh.square_sum_mm2 / samples) : 0, mesh.max_mm});
  }
  return all;
}

}  // namespace mvstudio::synth
