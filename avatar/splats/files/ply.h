#pragma once

#include <string>
#include <vector>

#include "avatar/splats/cloud.h"

/// Gaussians for viewers: docs/formats.md. Files are written by WriteFileAtomic; reading throws IoError, or FormatError with
/// the place.
namespace mvstudio::splats {

inline constexpr char kPlyFileName[] = "gaussians.ply";

/// Gaussians in space as viewers of 3D Gaussian splatting read them: binary PLY with x, y, z, nx, ny, nz, f_dc_*, f_rest_*,
/// opacity, scale_*, rot_* (w first), Kerbl et al., TOG 2023.
struct PlySplats {
  int degree = 0;
  std::vector<float> xyz;        // (N, 3)
  std::vector<float> normal;     // (N, 3)
  std::vector<float> colour;     // (N, 3 BasisSize(degree)): f_dc of R, G, B, then f_rest: all of R, all of G, all of B
  std::vector<float> opacity;    // (N) logit
  std::vector<float> log_scale;  // (N, 3)
  std::vector<float> rotation;   // (N, 4) w, x, y, z

  size_t size() const { return opacity.size(); }
};

/// The cloud on vertices (3, V) in a frame: with its 3D filter in scales and opacities, harmonics turned into that frame.
/// Gaussians that have no place (triangles without area, numbers that are not finite) are left out.
PlySplats ToPly(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices);

std::string PlyBytes(const PlySplats& splats);
/// Reads what PlyBytes writes, and files of other programs with the same attributes in any order, further float attributes
/// among them; f_rest of degrees 0 to 3, of which degree 3 is dropped.
PlySplats ParsePly(const std::string& bytes, const std::string& path);
void WritePly(const PlySplats& splats, const std::string& path);
PlySplats ReadPly(const std::string& path);

}  // namespace mvstudio::splats
