#include <nlohmann/json.hpp>

#include "dataset/exports/writers.h"

/// HuMMan-Recon's colour cameras: cameras.json (K, R, T world to camera, the first camera is the world) and PNG images.
namespace mvstudio::exports {

void WriteHumman(const Job& job) {
  using Json = nlohmann::ordered_json;
  const Take& take = job.take;
  const geometry::Rigid3 world_from_first = Inverse(take.views[0].camera.cam_from_world);
  Json cameras = Json::object();
  for (size_t i = 0; i < take.views.size(); ++i) {
    const geometry::Camera& lens = take.views[i].camera.camera;
    const geometry::Rigid3 cam_from_first =
        i == 0 ? geometry::Rigid3() : take.views[i].camera.cam_from_world * world_from_first;
    const Eigen::Matrix3d r = cam_from_first.rotation.toRotationMatrix();
    const Eigen::Vector3d& t = cam_from_first.translation;
    Json rotation = Json::array();
    for (int row = 0; row < 3; ++row) rotation.push_back({r(row, 0), r(row, 1), r(row, 2)});
    cameras[Numbered("kinect_color_", static_cast<int>(i), 3, "")] = {
        {"K", {{lens.fx(), 0.0, lens.cx()}, {0.0, lens.fy(), lens.cy()}, {0.0, 0.0, 1.0}}},
        {"R", rotation},
        {"T", {t.x(), t.y(), t.z()}}};
  }
  job.Write("cameras.json", cameras.dump(1) + "\n");
  for (const int frame : take.frames) {
    for (size_t i = 0; i < take.views.size(); ++i) {
      const std::string stem = Numbered(Numbered("/kinect_", static_cast<int>(i), 3, "/"), frame, 6, "");
      job.images.AddImage(i, frame, "kinect_color" + stem, ".png");
      job.images.AddMask(i, frame, "kinect_mask" + stem + ".png");
    }
  }
}

}  // namespace mvstudio::exports
