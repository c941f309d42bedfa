// Private: for formats.cc and opencv.cc.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "calib/formats/formats.h"

/// Cameras of photogrammetry and of vision's benchmarks: matrices in text, Metashape's XML, openMVG's JSON.
namespace mvstudio::calib::internal {

/// Whether text is one of these, all camera from world, pixel (0, 0) in the middle of a pixel:
///   KRTD of VXL and KWIVER: K, R, t, OpenCV's distortion;
///   MVSNet's `extrinsic` 4x4 and `intrinsic` 3x3;
///   Strecha's .camera: K, three zeros, the transposed R, the centre, width and height;
///   a projection matrix 3x4 of a focal length above 1, perhaps under `CONTOUR` (Furukawa's and DTU's *_P.txt), of any scale;
///   Middlebury's par: a count, then NAME, K, R, t in each line;
///   KRT of Neural Volumes and Multiface: NAME, K, OpenCV's distortion, [R t] of each camera;
///   Bundler's bundle.out: f, k1 and k2 about the image's middle, y up, looking along -z. Cameras with f = 0 are left out,
///   with a note.
bool IsMatrixText(std::string_view text);
/// One camera a file, or one file of several. Throws UsageError where the image size is in neither file nor options.
ImportedRig ReadMatrixText(const std::vector<std::string>& paths, const ReadOptions& options);

/// The note CAL-IGNORED of cameras without a pose, where there are some.
void AddLeftOut(const std::string& path, const std::vector<std::string>& names, std::vector<Notice>* notes);

/// Whether XML is Metashape's of aligned cameras.
bool IsMetashapeCameras(std::string_view text);
/// Frame cameras: f, cx, cy from the image's middle, b1, b2, k1 to k3, and p1, p2 in the other order than OpenCV's. The world
/// is that of the chunk, by its transform or those of its components. Cameras that were not aligned are left out, with a note.
/// Throws FormatError for fisheye sensors, k4, and cameras of several components of which one has no transform.
ImportedRig ReadMetashape(const std::string& path, const ReadOptions& options);

/// Whether JSON is openMVG's sfm_data of cameras with poses.
bool IsOpenMvg(std::string_view json);
/// Views with a pose, others are left out with a note: pinhole, radial k1 and k3, Brown t2, fisheye. x_in_cam = rotation
/// (x_in_world - center); pixel (0, 0) is the middle of a pixel.
ImportedRig ReadOpenMvg(const std::string& path, const ReadOptions& options);

}  // namespace mvstudio::calib::internal
