// Private: names of what OpenCV's files hold, for opencv.cc.
#pragma once

#include <initializer_list>
#include <optional>
#include <string>

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

}  // namespace mvstudio::calib::internal
