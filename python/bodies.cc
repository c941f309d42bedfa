#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "avatar/body/files/textured_person.h"
#include "avatar/splats/files/cloud_file.h"
#include "avatar/splats/render.h"
#include "core/error.h"
#include "geometry/rigid/rigid3.h"
#include "python/arrays.h"
#include "python/bindings.h"

/// Fitted bodies and Gaussians on them. Shapes, units and frames are said in mvstudio/_body.py.
namespace mvstudio::python {
namespace {

using body::ArticulatedPose;
using body::BodyTemplate;
using body::TexturedPerson;
using Rows3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Rows4 = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>;
using HeldBody = std::shared_ptr<TexturedPerson>;

/// A column each -> a row each.
template <class Matrix>
py::object RowsOf(const Matrix& columns) {
  using Scalar = typename Matrix::Scalar;
  return py::cast(Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>(columns.transpose()));
}

py::array_t<uint8_t> BytesOf(const Image& image) {
  Shape shape{image.height, image.width};
  if (image.channels > 1) shape.push_back(image.channels);
  py::array_t<uint8_t> array(shape);
  std::copy(image.pixels.begin(), image.pixels.end(), array.mutable_data());
  return array;
}

/// (24, S, S, 3)
py::array_t<uint8_t> TexturesOf(const TexturedPerson& person) {
  const Image& first = person.textures[0];
  py::array_t<uint8_t> array(Shape{body::kNumParts, first.height, first.width, first.channels});
  uint8_t* to = array.mutable_data();
  for (const Image& chart : person.textures) to = std::copy(chart.pixels.begin(), chart.pixels.end(), to);
  return array;
}

py::dict BodyArrays(const TexturedPerson& person) {
  const BodyTemplate& body = person.person.body;
  py::dict arrays;
  arrays["vertices"] = RowsOf(body.vertices), arrays["faces"] = RowsOf(body.faces);
  arrays["face_part"] = py::array_t<int>(static_cast<py::ssize_t>(body.face_part.size()), body.face_part.data());
  arrays["face_uv"] = RowsOf(body.face_uv);
  arrays["bone_names"] = body.bone_names;
  arrays["bone_parents"] = py::array_t<int>(static_cast<py::ssize_t>(body.bone_parents.size()), body.bone_parents.data());
  arrays["bone_heads"] = RowsOf(body.bone_heads), arrays["bone_tails"] = RowsOf(body.bone_tails);
  arrays["skin_bones"] = RowsOf(body.skin_bones), arrays["skin_weights"] = RowsOf(body.skin_weights);
  arrays["coco19"] = RowsOf(body.coco19);
  arrays["moves"] = body.pose_directions.size() > 0 || body.moving_offsets != nullptr;
  return arrays;
}

py::tuple TupleOf(const ArticulatedPose& pose) {
  Rows4 rotations(static_cast<Eigen::Index>(pose.local_rotations.size()), 4);
  for (size_t b = 0; b < pose.local_rotations.size(); ++b)
    rotations.row(static_cast<Eigen::Index>(b)) = pose.local_rotations[b].coeffs().transpose();
  return py::make_tuple(Eigen::Vector3d(pose.shift), rotations);
}

ArticulatedPose PoseOf(const TexturedPerson& person, const Eigen::Vector3d& shift, const Rows4& rotations) {
  const size_t bones = person.person.body.bone_parents.size();
  if (static_cast<size_t>(rotations.rows()) != bones)
    throw UsageError("option 'pose': " + std::to_string(rotations.rows()) + " rotations; the body has " +
                     std::to_string(bones) + " bones");
  ArticulatedPose pose;
  pose.shift = shift;
  for (Eigen::Index b = 0; b < rotations.rows(); ++b) {
    const Eigen::Vector4d q = rotations.row(b);
    if (!(std::abs(q.norm() - 1) < 1e-3))
      throw UsageError("option 'pose': rotation " + std::to_string(b) + " is no unit quaternion");
    pose.local_rotations.push_back(Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized());
  }
  return pose;
}

py::tuple SeenPose(const HeldBody& held, int frame) {
  const auto& seen = held->person.seen;
  const auto found = seen.find(frame);
  if (found != seen.end()) return TupleOf(found->second);
  throw UsageError("option 'frame' " + std::to_string(frame) + ": " +
                   (seen.empty() ? "the body holds no pose"
                                 : "the body holds poses of frames " + std::to_string(seen.begin()->first) + " to " +
                                       std::to_string(seen.rbegin()->first)));
}

py::tuple PoseBy(const HeldBody& held, const Rows3& joints_in_world) {
  if (joints_in_world.rows() != 19)
    throw UsageError("option 'joints': expected shape (19, 3), got (" + std::to_string(joints_in_world.rows()) + ", 3)");
  Eigen::Matrix3Xd joints = joints_in_world.transpose();
  std::array<bool, 19> valid{};
  for (int j = 0; j < 19; ++j) {
    valid[j] = joints.col(j).allFinite();
    if (!valid[j]) joints.col(j).setZero();
  }
  const auto pose = body::PoseByJoints(held->person, joints, valid);
  if (!pose) throw UsageError("option 'joints': neck, shoulders and hips do not determine the trunk");
  return TupleOf(*pose);
}

py::object Vertices(const HeldBody& held, const Eigen::Vector3d& shift, const Rows4& rotations) {
  const BodyTemplate& body = held->person.body;
  return RowsOf(body::SkinVertices(body, ToBodyPose(body, PoseOf(*held, shift, rotations))));
}

py::object Joints(const HeldBody& held, const Eigen::Vector3d& shift, const Rows4& rotations) {
  const BodyTemplate& body = held->person.body;
  return RowsOf(body::PosedCoco19(body, ToBodyPose(body, PoseOf(*held, shift, rotations))));
}

geometry::RigCamera PinholeOf(const Eigen::Matrix3d& K, const Eigen::Matrix4d& cam_from_world, int width_px, int height_px) {
  const bool form = K(0, 1) == 0 && K(1, 0) == 0 && K(2, 0) == 0 && K(2, 1) == 0 && K(2, 2) == 1 && K(0, 0) > 0 && K(1, 1) > 0;
  if (!form || !K.allFinite()) throw UsageError("option 'K': is no matrix of a camera without skew");
  if (!cam_from_world.allFinite()) throw UsageError("option 'cam-from-world': holds numbers that are not finite");
  if (width_px < 1 || height_px < 1 || width_px > 16384 || height_px > 16384)
    throw UsageError("option 'size-px': use 1 to 16384");
  geometry::RigCamera camera;
  camera.camera.name = "view", camera.camera.model = geometry::LensModel::kPinhole;
  camera.camera.width_px = width_px, camera.camera.height_px = height_px;
  camera.camera.params = Eigen::Vector4d(K(0, 0), K(1, 1), K(0, 2), K(1, 2));
  camera.cam_from_world.rotation = geometry::NearestRotation(cam_from_world.topLeftCorner<3, 3>());
  camera.cam_from_world.translation = cam_from_world.topRightCorner<3, 1>();
  return camera;
}

/// The body in its colours, or the Gaussians on it: (h, w, 3) premultiplied, and coverage (h, w).
py::tuple Render(const HeldBody& held, const std::shared_ptr<splats::CloudFile>& gaussians, const Eigen::Vector3d& shift,
                 const Rows4& rotations, const Eigen::Matrix3d& K, const Eigen::Matrix4d& cam_from_world, int width_px,
                 int height_px, int threads) {
  const BodyTemplate& body = held->person.body;
  const geometry::RigCamera camera = PinholeOf(K, cam_from_world, width_px, height_px);
  const ArticulatedPose pose = PoseOf(*held, shift, rotations);
  body::RenderedBody seen;
  {
    const py::gil_scoped_release others_run;
    const Eigen::Matrix3Xf vertices = body::SkinVertices(body, ToBodyPose(body, pose));
    seen = gaussians ? splats::RenderGaussians(gaussians->cloud, body, vertices, camera, {gaussians->mip, threads})
                     : body::RenderBody(body, held->textures, vertices, camera);
  }
  return py::make_tuple(BytesOf(seen.image), BytesOf(seen.cover));
}

py::dict AboutGaussians(const splats::CloudFile& file) {
  py::dict about;
  about["size"] = file.cloud.size(), about["size_px"] = file.size_px, about["step"] = file.step, about["mip"] = file.mip;
  about["degree"] = file.cloud.values.degree, about["options"] = file.options;
  return about;
}

}  // namespace

void BindBodies(py::module_& module) {
  py::class_<TexturedPerson, HeldBody> held(module, "Body");
  held.def(py::init([](const std::string& path) { return std::make_shared<TexturedPerson>(body::ReadPerson(path)); }));
  held.def("arrays", BodyArrays);
  held.def("textures", TexturesOf);
  held.def("frames", [](const TexturedPerson& person) {
    std::vector<int> frames;
    for (const auto& [frame, pose] : person.person.seen) frames.push_back(frame);
    return frames;
  });
  held.def("seen_pose", SeenPose);
  held.def("pose_by_joints", PoseBy);
  held.def("vertices", Vertices);
  held.def("joints", Joints);
  held.def("render", Render);
  py::class_<splats::CloudFile, std::shared_ptr<splats::CloudFile>> cloud(module, "Gaussians");
  cloud.def(py::init([](const std::string& path, const HeldBody& on) {
    return std::make_shared<splats::CloudFile>(splats::ReadCloud(path, static_cast<int>(on->person.body.faces.cols())));
  }));
  cloud.def("about", AboutGaussians);
}

}  // namespace mvstudio::python
