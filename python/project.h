// Private: pybind11's types.
#pragma once

#include <string>

#include "python/arrays.h"
#include "python/rig.h"

/// The loops of a rig over arrays. Shapes, units and frames are said in mvstudio/_rig.py.
namespace mvstudio::python {

/// (..., 3) metres, in world or, with `in_cam`, in the camera -> (..., 2) px; NaN where there is no pixel.
py::array_t<double> Project(const HeldRig& held, const Doubles& points, const py::object& camera, bool in_cam, int threads);
/// The same with d px / d point (..., 2, 3) and d px / d lens parameters (..., 2, P).
py::tuple ProjectWithJacobians(const HeldRig& held, const Doubles& points, const py::object& camera, bool in_cam, int threads);
/// (..., 2) px -> (..., 3) unit rays, in the camera or in world.
py::array_t<double> Unproject(const HeldRig& held, const Doubles& px, const py::object& camera, bool in_world, int threads);
/// (..., 2) px at a distance -> (...) px.
py::array_t<double> UncertaintyPx(const HeldRig& held, const Doubles& px, const py::object& camera, double range_m,
                                  int threads);
/// (map (h, w, 2) px of the footage, K (3, 3)) of a pinhole.
py::tuple UndistortionMap(const HeldRig& held, const py::object& camera, const std::string& view, int width_px, int height_px,
                          double max_fov_deg, int threads);

}  // namespace mvstudio::python
