#include "python/rig.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "core/error.h"
#include "core/join.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "python/bindings.h"
#include "python/project.h"
#include "stages/input/calib_read.h"

namespace mvstudio::python {
namespace py = pybind11;
namespace {

std::shared_ptr<HeldRig> Read(const std::vector<std::string>& paths, const std::string& from, const std::string& size,
                              const std::string& unit, const std::string& lens, double frame_rate_hz, bool invert, bool mirror,
                              double allow_approximation_px) {
  stages::CalibReadOptions options;
  SetFromString(from, "from", &options.from);
  if (!size.empty()) SetFromString(size, "size", &options.size);
  SetFromString(unit, "unit", &options.unit);
  SetFromString(lens, "lens", &options.lens);
  options.frame_rate_hz = frame_rate_hz, options.invert = invert, options.mirror = mirror;
  options.allow_approximation_px = allow_approximation_px;
  calib::ImportedRig read;
  {
    const py::gil_scoped_release others_run;
    read = stages::ReadCalibrationFiles(paths, options);
  }
  return std::make_shared<HeldRig>(std::move(read.rig), std::move(read.notes));
}

Eigen::Matrix4d CamFromWorld(const HeldRig& held, const py::object& frame) {
  if (py::isinstance<py::str>(frame) && frame.cast<std::string>() == "world" && held.rig.Find("world") < 0)
    return Eigen::Matrix4d::Identity();
  return geometry::ToMatrix(held.rig.cameras[held.Camera(frame)].cam_from_world);
}

Eigen::Matrix4d BFromA(const HeldRig& held, const py::object& b, const py::object& a) {
  const Eigen::Matrix4d a_from_world = CamFromWorld(held, a);
  Eigen::Matrix4d world_from_a = Eigen::Matrix4d::Identity();
  world_from_a.topLeftCorner<3, 3>() = a_from_world.topLeftCorner<3, 3>().transpose();
  world_from_a.topRightCorner<3, 1>() = -world_from_a.topLeftCorner<3, 3>() * a_from_world.topRightCorner<3, 1>();
  return CamFromWorld(held, b) * world_from_a;
}

std::shared_ptr<HeldRig> Subset(const HeldRig& held, const std::vector<py::object>& cameras) {
  std::vector<size_t> indices;
  for (const py::object& camera : cameras) indices.push_back(held.Camera(camera));
  return std::make_shared<HeldRig>(geometry::SubsetOf(held.rig, indices));
}

py::list Notes(const HeldRig& held) {
  py::list notes;
  for (const Notice& note : held.notes) notes.append(py::make_tuple(note.code, note.text, note.hint));
  return notes;
}

using Class = py::class_<HeldRig, std::shared_ptr<HeldRig>>;

void BindCameras(Class& rig) {
  rig.def("__len__", [](const HeldRig& held) { return held.rig.cameras.size(); });
  rig.def("index", &HeldRig::Camera);
  rig.def("names", [](const HeldRig& held) { return geometry::CameraNames(held.rig); });
  rig.def("size_px", [](const HeldRig& held, const py::object& camera) {
    const geometry::Camera& c = held.rig.cameras[held.Camera(camera)].camera;
    return py::make_tuple(c.width_px, c.height_px);
  });
  rig.def("model", [](const HeldRig& held, const py::object& camera) {
    return std::string(geometry::ToString(held.rig.cameras[held.Camera(camera)].camera.model));
  });
  rig.def("params", [](const HeldRig& held, const py::object& camera) {
    return Eigen::VectorXd(held.rig.cameras[held.Camera(camera)].camera.params);
  });
  rig.def("param_names", [](const HeldRig& held, const py::object& camera) {
    return geometry::ParamNames(held.rig.cameras[held.Camera(camera)].camera);
  });
  rig.def("K", [](const HeldRig& held, const py::object& camera) { return held.rig.cameras[held.Camera(camera)].camera.K(); });
  rig.def("b_from_a", BFromA, py::arg("b"), py::arg("a"));
  rig.def("valid_radius",
          [](const HeldRig& held, const py::object& camera) { return held.projectors[held.Camera(camera)].valid_radius(); });
}

void BindCovariance(Class& rig) {
  rig.def("joint_covariance", [](const HeldRig& held) { return held.rig.joint_covariance; });
  rig.def("params_covariance", [](const HeldRig& held, const py::object& camera) {
    return held.rig.cameras[held.Camera(camera)].params_covariance;
  });
  rig.def("pose_covariance", [](const HeldRig& held, const py::object& camera) {
    return held.rig.cameras[held.Camera(camera)].cam_from_world_covariance;
  });
}

}  // namespace

HeldRig::HeldRig(geometry::Rig rig_, std::vector<Notice> notes_) : rig(std::move(rig_)), notes(std::move(notes_)) {
  for (const geometry::RigCamera& camera : rig.cameras) projectors.emplace_back(camera.camera);
}

size_t HeldRig::Camera(const py::object& camera) const {
  const auto size = static_cast<py::ssize_t>(rig.cameras.size());
  if (py::isinstance<py::str>(camera)) {
    const std::string name = camera.cast<std::string>();
    const int found = rig.Find(name);
    if (found >= 0) return static_cast<size_t>(found);
    throw UsageError("option 'camera': the rig has no camera '" + name + "'; it has " + Join(geometry::CameraNames(rig), ", "));
  }
  const py::ssize_t given = PyNumber_AsSsize_t(camera.ptr(), PyExc_IndexError);
  if (given == -1 && PyErr_Occurred()) throw py::error_already_set();
  const py::ssize_t index = given < 0 ? given + size : given;
  if (index < 0 || index >= size)
    throw UsageError("option 'camera': " + std::to_string(given) + " is none of the rig's " + std::to_string(size) +
                     " cameras");
  return static_cast<size_t>(index);
}

void BindRig(py::module_& module) {
  Class rig(module, "Rig");
  rig.def(py::init(&Read));
  rig.def_static("from_json", [](const std::string& text) {
    return std::make_shared<HeldRig>(geometry::RigFromJsonText(text, "the text"));
  });
  rig.def("to_json", [](const HeldRig& held) { return geometry::RigToJsonText(held.rig); });
  rig.def("write", [](const HeldRig& held, const std::string& path) { geometry::WriteRig(held.rig, path); });
  rig.def("subset", Subset);
  rig.def("gauge", [](const HeldRig& held) { return geometry::GaugeText(held.rig.gauge); });
  rig.def("notes", Notes);
  BindCameras(rig);
  BindCovariance(rig);
  rig.def("project", Project);
  rig.def("project_with_jacobians", ProjectWithJacobians);
  rig.def("unproject", Unproject);
  rig.def("uncertainty_px", UncertaintyPx);
  rig.def("undistortion_map", UndistortionMap);
}

}  // namespace mvstudio::python
