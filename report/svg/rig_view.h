#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace mvstudio::report {

using Vector3 = std::array<double, 3>;  ///< metres

/// A camera of the rig figure.
struct ViewCamera {
  std::string name;
  Vector3 center_in_world{};
  std::array<std::array<double, 3>, 3> world_from_cam{};  ///< columns: the camera's right, down and forward in world
  double half_width = 0.5, half_height = 0.375;           ///< half the image at unit depth (size / 2 / focal length)
};

struct ViewBone {
  Vector3 from{}, to{};
  std::string colour = {};  ///< "#rrggbb"; empty: the page's
};

/// The content of the volume between the cameras.
struct ViewSubject {
  std::vector<Vector3> cloud;   ///< joints of all frames
  std::vector<Vector3> path;    ///< mean of the joints, frame after frame; a gap is a NaN
  std::vector<ViewBone> bones;  ///< one pose
};

/// Sets the pose from `cam_from_world`: a quaternion (x, y, z, w) of any length and a translation. NaN input gives NaN.
void SetPose(const std::array<double, 4>& rotation_xyzw, const Vector3& translation_m, ViewCamera* camera);

/// The world axis that points up, from the cameras' own up directions: +-(index + 1); 3 is +z.
int UpAxis(const std::vector<ViewCamera>& cameras);

/// View from above, and from a corner above (orthographic, equal scale on all axes), with frusta, names, a floor grid and
/// a scale bar.
std::string RigTopView(const std::vector<ViewCamera>& cameras, const ViewSubject& subject, double width = 520);
std::string RigCornerView(const std::vector<ViewCamera>& cameras, const ViewSubject& subject, double width = 520);

/// The subject's one pose alone, as large as the figure, from the same corner; empty without bones.
std::string SubjectView(const std::vector<ViewCamera>& cameras, const ViewSubject& subject, double width = 300);

}  // namespace mvstudio::report
