#include "geometry/rig/foreign_layout.h"

#include <algorithm>
#include <initializer_list>

namespace mvstudio::geometry {
namespace {

bool HasAll(std::string_view text, std::initializer_list<const char*> pieces) {
  return std::all_of(pieces.begin(), pieces.end(),
                     [&](const char* piece) { return text.find(piece) != std::string_view::npos; });
}

struct Layout {
  const char* name;
  std::initializer_list<const char*> pieces;
};

const Layout kLayouts[] = {
    {"glTF", {"\"asset\"", "\"nodes\""}},
    {"MVHumanNet's camera_extrinsics.json (its intrinsics and its scale stand in other files)",
     {"\"focal_length\"", "\"image_center\""}},
    {"AvatarReX's calibration_full.json", {"\"distCoeff\"", "\"imgSize\""}},
    {"cameras of the Captury's or Skeletool's .calibration (write its intrinsic and extrinsic rows as K, R and T)",
     {"Skeletool Camera Calibration"}},
    {"KITTI's calib.txt of projection matrices (K, R and T are needed)", {"P0:", "P1:", "P2:"}},
    {"Polycam's cameras, a file each", {"\"t_00\"", "\"t_23\""}},
    {"Dynamic 3D Gaussians' meta file", {"\"w2c\"", "\"k\"", "\"cam_id\""}},
    {"Fit3D's camera parameters", {"\"intrinsics_w_distortion\"", "\"extrinsics\""}},
    {"poses without lenses of camera-intrinsic-calibration-rs", {"\"rtvecs\"", "\"tvec\""}},
    {"ROS's .ini (convert it to .yaml with camera_calibration_parsers)", {"[image]", "camera matrix", "projection"}},
    {"openMVG's sfm_data without lenses", {"\"sfm_data_version\""}},
    {"AliceVision's scene (Meshroom's node ExportColmap writes it for COLMAP)", {"\"intrinsicId\""}},
    {"VisualSFM's model (its distortion goes from distorted to undistorted; save it as Bundler's .out without distortion)",
     {"NVM_V3"}},
    {"OCamCalib's polynomial lens (calibrate its boards again: mvstudio calibrate chooses a wide lens itself)",
     {"#polynomial coefficients", "#affine parameters"}},
    {"RealityCapture's cameras (its export for COLMAP is read)", {"#name,x,y,alt"}},
    {"RealityCapture's cameras (its export for COLMAP is read)", {"capturingreality.com"}},
    {"Theia's priors, no result (its export for COLMAP or Bundler is read)", {"\"CameraIntrinsicsPrior\""}},
    {"Record3D's metadata of one moving phone (nerfstudio's ns-process-data makes transforms.json of it)",
     {"\"K\"", "\"poses\"", "\"fps\""}},
    {"DSO's lens (write fx fy cx cy and its terms as OpenCV's camera_matrix and distortion_coefficients; below 1 they are "
     "shares of the width and height)",
     {"\ncrop\n"}},
    {"OpenSfM's reconstruction.json", {"\"shots\"", "\"rotation\""}},
    {"MVHumanNet's camera_intrinsics.json (lenses without poses)", {"\"intrinsics\"", "\"dist\""}},
    {"a session or result of mvstudio, no calibration", {"\"exit_code\"", "\"metrics\""}},
    {"cameras of VoxelPose or Campus and Shelf", {"\"R\"", "\"fx\"", "\"fy\"", "\"cx\""}},
    {"cameras by K, R and T (HuMMan and others)", {"\"K\"", "\"R\"", "\"T\""}},
    {"Metashape's XML (File > Export > Export Cameras writes it for COLMAP, too)", {"<document", "<chunk"}},
    {"Metashape's XML of one lens (its Tools > Camera Calibration saves it for OpenCV, too)", {"<projection>", "<calibration"}},
    {"Vicon's .xcp", {"<Camera", "PRINCIPAL_POINT"}},
    {"OptiTrack's profile", {"<Profile"}},
    {"Pix4D's calibrated camera parameters", {"fileName imageWidth imageHeight", "camera matrix K"}},
    {"a RealSense lens (its Inverse Brown-Conrady terms go from distorted to undistorted)",
     {"\"ppx\"", "\"ppy\"", "\"coeffs\""}},
    {"Azure Kinect's calibration", {"\"CalibrationInformation\"", "\"ModelParameters\""}},
    {"ZED's .conf (write its fx fy cx cy k1 k2 p1 p2 k3 as OpenCV's camera_matrix and distortion_coefficients)",
     {"_CAM_", "fx", "[STEREO]"}},
    {"Bouguet's toolbox for MATLAB (pixels from 0: write fc, cc and kc as OpenCV's camera_matrix and "
     "distortion_coefficients)",
     {"fc =", "cc =", "kc ="}},
    {"MultiCamSelfCal's .rad (write K and kc as OpenCV's camera_matrix and distortion_coefficients)", {"K11 =", "kc1 ="}},
    {"XMALab's MayaCam file (its y axis points up)", {"camera matrix", "rotation", "translation"}},
    {"EuRoC's sensor.yaml of another sensor than a camera", {"sensor_type:", "T_BS:"}},
};

}  // namespace

std::string ForeignLayout(std::string_view text) {
  const auto starts = [&](std::string_view magic) { return text.substr(0, magic.size()) == magic; };
  if (starts("PK\x03\x04")) return "a zip archive, such as NumPy's .npz";
  if (starts("\x1f\x8b")) return "a file that gzip packed (gunzip unpacks it)";
  if (starts("\x93NUMPY")) return "a NumPy array (.npy)";
  if (starts("\x89HDF")) return "an HDF5 file";
  if (starts("MATLAB")) return "a MATLAB file (.mat)";
  if (starts("\x80\x02") || starts("\x80\x03") || starts("\x80\x04")) return "a Python pickle";
  for (const Layout& layout : kLayouts) {
    if (HasAll(text, layout.pieces)) return layout.name;
  }
  return "";
}

bool IsMetashape(std::string_view text) { return HasAll(text, {"<document", "<chunk"}); }

bool LooksLikePanoptic(std::string_view json) {
  return HasAll(json, {"\"cameras\""}) && !HasAll(json, {"\"asset\"", "\"nodes\""});
}

}  // namespace mvstudio::geometry
