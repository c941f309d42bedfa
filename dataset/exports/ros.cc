#include "calib/formats/format_camera.h"
#include "core/error.h"
#include "dataset/exports/writers.h"

/// ROS's camera_info files (sensor_msgs/CameraInfo as camera_calibration_parsers reads them), one a camera. They have no pose.
namespace mvstudio::exports {
namespace {

std::string MatrixText(const std::string& name, int rows, const std::vector<double>& values) {
  std::string text = name + ":\n  rows: " + std::to_string(rows) +
                     "\n  cols: " + std::to_string(values.size() / static_cast<size_t>(rows)) + "\n  data: [";
  for (size_t i = 0; i < values.size(); ++i) text += (i ? ", " : "") + Num(values[i]);
  return text + "]\n";
}

std::string CameraInfo(const geometry::Camera& camera) {
  const auto lens = calib::internal::ToOpenCvLens(camera);
  if (!lens || lens->distortion.size() > 8) {
    throw FormatError("camera " + camera.name, "",
                      "ROS has plumb_bob, rational_polynomial and equidistant lenses, not " +
                          std::string(ToString(camera.model)) + "; choose another option 'to'");
  }
  std::vector<double> d(lens->distortion.data(), lens->distortion.data() + lens->distortion.size());
  const std::string model = lens->fisheye ? "equidistant" : d.size() > 5 ? "rational_polynomial" : "plumb_bob";
  if (model == "plumb_bob") d.resize(5, 0);
  const std::vector<double> k = MatrixOf(camera), p = {k[0], k[1], k[2], 0, k[3], k[4], k[5], 0, 0, 0, 1, 0};
  return "image_width: " + std::to_string(camera.width_px) + "\nimage_height: " + std::to_string(camera.height_px) +
         "\ncamera_name: " + camera.name + "\n" + MatrixText("camera_matrix", 3, k) + "distortion_model: " + model + "\n" +
         MatrixText("distortion_coefficients", 1, d) + MatrixText("rectification_matrix", 3, {1, 0, 0, 0, 1, 0, 0, 0, 1}) +
         MatrixText("projection_matrix", 3, p);
}

}  // namespace

void WriteRos(const Job& job) {
  for (const View& view : job.take.views) job.Write(view.info.name + ".yaml", CameraInfo(view.camera.camera));
  if (job.take.views.size() > 1) {
    job.report->notes.push_back({"EXP-NO-POSE", "ROS's camera_info has no pose: where the cameras stand is not written",
                                 "publish the poses of the calibration as static transforms"});
  }
}

}  // namespace mvstudio::exports
