#pragma once

#include <string>
#include <string_view>

#include "triangulate/point/point.h"

namespace mvstudio::triangulate {

/// How the points of a take are solved.
struct TakeMethod {
  enum class Kind {
    kAuto,           ///< "auto": the cheapest point method that held-out views justify
    kPoint,          ///< the name of a PointMethod
    kExhaustiveDlt,  ///< "exhaustive-dlt": Pose2Sim's
  };
  Kind kind = Kind::kAuto;
  PointMethod point = PointMethod::kRobust;  ///< of kPoint

  bool IsAuto() const { return kind == Kind::kAuto; }
  bool IsExhaustiveDlt() const { return kind == Kind::kExhaustiveDlt; }
};

inline TakeMethod ByPoint(PointMethod point) { return {TakeMethod::Kind::kPoint, point}; }
/// As an option, see core/fields.h.
std::string_view ToString(const TakeMethod& method);
void FromString(const std::string& text, TakeMethod* method);

}  // namespace mvstudio::triangulate
