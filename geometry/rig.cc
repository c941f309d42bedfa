#include "geometry/rig.h"

namespace mvstudio::geometry {

int Rig::Find(const std::string& name) const {
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].camera.name == name) return static_cast<int>(i);
  }
  return -1;
}

}  // namespace mvstudio::geometry
