#include "triangulate/take/method.h"

#include "core/error.h"
#include "core/join.h"

namespace mvstudio::triangulate {
namespace {

constexpr char kAuto[] = "auto";
constexpr char kExhaustiveDlt[] = "exhaustive-dlt";

std::string TakeMethodNames() {
  const std::string points = Join(kAllPointMethods, ", ", [](PointMethod method) { return ToString(method); });
  return std::string(kAuto) + ", " + points + ", " + kExhaustiveDlt;
}

}  // namespace

std::string_view ToString(const TakeMethod& method) {
  if (method.IsAuto()) return kAuto;
  return method.IsExhaustiveDlt() ? kExhaustiveDlt : ToString(method.point);
}

void FromString(const std::string& text, TakeMethod* method) {
  const std::optional<PointMethod> point = PointMethodFromString(text);
  if (text == kAuto) {
    *method = {};
  } else if (text == kExhaustiveDlt) {
    *method = {TakeMethod::Kind::kExhaustiveDlt};
  } else if (point) {
    *method = ByPoint(*point);
  } else {
    throw UsageError("option 'method' " + text + " is unknown; choose one of " + TakeMethodNames());
  }
}

}  // namespace mvstudio::triangulate
