// Private: names of what OpenCV's files hold, for opencv.cc.
#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "calib/formats/opencv_yaml.h"

namespace mvstudio::calib::internal {

inline constexpr std::initializer_list<const char*> kDistortionKeys = {"distortioncoefficients",
                                                                       "distortioncoeffs",
                                                                       "distortioncoef",
                                                                       "distcoeffs",
                                                                       "distcoeff",
                                                                       "distcoefs",
                                                                       "distcoef",
                                                                       "distortion",
                                                                       "d",
                                                                       "dist",
                                                                       "distortionvector",
                                                                       "coeffs",
                                                                       "kc",
                                                                       "distcoefficients",
                                                                       "distortioncoefs",
                                                                       "distortioncoefficient",
                                                                       "distortionparameters",
                                                                       "distortionparams",
                                                                       "distortions",
                                                                       "distparams",
                                                                       "lensdistortion",
                                                                       "cameradistortion"};
/// The pose of the second of two cameras.
inline constexpr std::initializer_list<const char*> kRotationKeys = {"r", "rotation", "rotationmatrix", "rot", "rmat"};
inline constexpr std::initializer_list<const char*> kTranslationKeys = {"t", "translation", "translationvector", "trans",
                                                                        "tvec"};

/// Names of the matrices and coefficients of both cameras.
struct StereoKeys {
  std::string matrix1, distortion1, matrix2, distortion2;
};

/// Those that the entries have: both matrices, which a number of that name (a lens's k1) is not. Names with coefficients come
/// before names without.
std::optional<StereoKeys> StereoKeysOf(const Entries& entries);

/// JARVIS multiplies rows from the right: its `intrinsicMatrix` and R stand transposed.
bool IsJarvis(const Entries& entries);

/// OpenPose's `CameraMatrix` is [R t], and its `Intrinsics` the matrix of the lens.
bool IsOpenPose(const Entries& entries);

geometry::Rigid3 ReadPose(const Entry& rotation, const Entry& translation, double metres_per_unit);

/// The camera's pose, camera from world, metres, if the entries have one: R and T, rvec and tvec, one matrix of both in either
/// direction, or OpenPose's 3x4 `CameraMatrix`.
std::optional<geometry::Rigid3> FindPose(const Entries& entries, double metres_per_unit);

/// Of several cameras without a pose that is known here: throws FormatError for one that has it by another name, which would
/// be dropped.
void RefuseOtherPoses(const std::vector<Entries>& cameras);

}  // namespace mvstudio::calib::internal
