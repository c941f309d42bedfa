#include "avatar/splats/cloud.h"

#include <algorithm>

#include "core/check.h"

namespace mvstudio::splats {

template <class S>
void CheckCloud(const BasicCloud<S>& cloud, int num_faces) {
  const size_t n = cloud.size();
  MVS_CHECK(cloud.values.degree >= 0 && cloud.values.degree <= kMaxDegree, "degree " << cloud.values.degree);
  MVS_CHECK(cloud.filter_variance.size() == n, cloud.filter_variance.size() << " filters of " << n << " Gaussians");
  MVS_CHECK(cloud.values.bends || cloud.values.bend.empty(), "a corrective that is switched off");
  ForEachGroup(cloud.values, [&](Group group, int width, const std::vector<S>& array) {
    MVS_CHECK(array.size() == n * static_cast<size_t>(width),
              "array " << static_cast<int>(group) << " has " << array.size() << " numbers for " << n << " Gaussians");
  });
  for (const int face : cloud.face) MVS_CHECK(face >= 0 && face < num_faces, "face " << face << " of " << num_faces);
}

template void CheckCloud(const BasicCloud<float>&, int);
template void CheckCloud(const BasicCloud<double>&, int);

Parameters<float> Select(const Parameters<float>& values, const std::vector<size_t>& indices) {
  Parameters<float> out = ZeroParameters<float>(indices.size(), values.degree, values.bends);
  std::vector<const std::vector<float>*> arrays;
  ForEachGroup(values, [&](Group, int, const std::vector<float>& array) { arrays.push_back(&array); });
  size_t group = 0;
  ForEachGroup(out, [&](Group, int width, std::vector<float>& array) {
    const std::vector<float>& from = *arrays[group++];
    for (size_t i = 0; i < indices.size(); ++i)
      std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(indices[i]) * width, width,
                  array.begin() + static_cast<std::ptrdiff_t>(i) * width);
  });
  return out;
}

Cloud Select(const Cloud& cloud, const std::vector<size_t>& indices) {
  Cloud out;
  for (const size_t i : indices) {
    out.face.push_back(cloud.face[i]);
    out.filter_variance.push_back(cloud.filter_variance[i]);
  }
  out.values = Select(cloud.values, indices);
  return out;
}

}  // namespace mvstudio::splats
