#include "avatar/body/offset_net/offset_net.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace mvstudio::body {
namespace {

using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int64_t kMostChannels = 1024;
constexpr float kMostActivation = 1e6f;  // never reached by what was trained; sums stay finite

/// Channels by pixels, row by row.
struct FeatureMap {
  int height = 0, width = 0;
  RowMajor values;  // (C, height * width)
};

Eigen::Map<const RowMajor> Weight(const NetArrays& arrays, const std::string& name) {
  const NetArray& array = arrays.at(name + ".weight");
  return {array.values.data(), array.shape[0], static_cast<Eigen::Index>(array.values.size()) / array.shape[0]};
}

Eigen::Map<const Eigen::VectorXf> Bias(const NetArrays& arrays, const std::string& name) {
  const NetArray& array = arrays.at(name + ".bias");
  return {array.values.data(), static_cast<Eigen::Index>(array.values.size())};
}

/// The inputs of every output pixel, (C kernel kernel, pixels), 0 outside the map.
RowMajor Patches(const FeatureMap& in, int kernel, int stride, int padding, int out_height, int out_width) {
  const auto channels = static_cast<int>(in.values.rows());
  RowMajor patches = RowMajor::Zero(static_cast<Eigen::Index>(channels) * kernel * kernel, out_height * out_width);
  for (int c = 0; c < channels; ++c) {
    for (int k = 0; k < kernel * kernel; ++k) {
      for (int y = 0; y < out_height; ++y) {
        const int from_y = y * stride + k / kernel - padding;
        if (from_y < 0 || from_y >= in.height) continue;
        for (int x = 0; x < out_width; ++x) {
          const int from_x = x * stride + k % kernel - padding;
          if (from_x >= 0 && from_x < in.width)
            patches(c * kernel * kernel + k, y * out_width + x) = in.values(c, from_y * in.width + from_x);
        }
      }
    }
  }
  return patches;
}

FeatureMap Convolve(const NetArrays& arrays, const std::string& name, const FeatureMap& in, int stride) {
  const auto kernel = static_cast<int>(arrays.at(name + ".weight").shape[2]);
  FeatureMap out{in.height / stride, in.width / stride, {}};
  out.values = Weight(arrays, name) * Patches(in, kernel, stride, stride == 2 ? 1 : kernel / 2, out.height, out.width);
  out.values.colwise() += Bias(arrays, name);
  return out;
}

FeatureMap ConvolveRelu(const NetArrays& arrays, const std::string& name, const FeatureMap& in, int stride) {
  FeatureMap out = Convolve(arrays, name, in, stride);
  out.values = out.values.cwiseMax(0).cwiseMin(kMostActivation);
  return out;
}

/// `coarse` twice as large, each pixel four times, with the channels of `fine` below.
FeatureMap Joined(const FeatureMap& coarse, const FeatureMap& fine) {
  FeatureMap out{fine.height, fine.width, RowMajor(coarse.values.rows() + fine.values.rows(), fine.values.cols())};
  for (int y = 0; y < fine.height; ++y) {
    for (int x = 0; x < fine.width; ++x)
      out.values.col(y * fine.width + x).head(coarse.values.rows()) = coarse.values.col(y / 2 * coarse.width + x / 2);
  }
  out.values.bottomRows(fine.values.rows()) = fine.values;
  return out;
}

FeatureMap PoseFeature(const NetArrays& arrays, const Eigen::Matrix3Xf& positions) {
  FeatureMap x{OffsetAtlas::kHeight, OffsetAtlas::kWidth, positions};
  x = ConvolveRelu(arrays, "stem", x, 1);
  std::vector<FeatureMap> levels;
  for (int level = 0; level < kOffsetNetDowns; ++level) {
    levels.push_back(x);
    x = ConvolveRelu(arrays, "down" + std::to_string(level), x, 2);
  }
  for (int level = kOffsetNetDowns - 1; level >= 0; --level)
    x = ConvolveRelu(arrays, "up" + std::to_string(level), Joined(x, levels[level]), 1);
  x = Convolve(arrays, "pose", x, 1);
  x.values = x.values.array().tanh();
  return x;
}

/// Bilinear between pixel centres, (C, V).
RowMajor Sample(const RowMajor& map, const Eigen::Matrix2Xf& at_px) {
  RowMajor values(map.rows(), at_px.cols());
  for (Eigen::Index v = 0; v < at_px.cols(); ++v) {
    const int x = std::min(static_cast<int>(at_px(0, v)), OffsetAtlas::kWidth - 2);
    const int y = std::min(static_cast<int>(at_px(1, v)), OffsetAtlas::kHeight - 2);
    const float right = at_px(0, v) - static_cast<float>(x), down = at_px(1, v) - static_cast<float>(y);
    const auto pixel = [&](int dx, int dy) { return map.col((y + dy) * OffsetAtlas::kWidth + x + dx); };
    values.col(v) = (1 - down) * ((1 - right) * pixel(0, 0) + right * pixel(1, 0)) +
                    down * ((1 - right) * pixel(0, 1) + right * pixel(1, 1));
  }
  return values;
}

RowMajor Linear(const NetArrays& arrays, const std::string& name, const RowMajor& in) {
  RowMajor out = Weight(arrays, name) * in;
  out.colwise() += Bias(arrays, name);
  return out;
}

RowMajor Stacked(const RowMajor& top, const RowMajor& bottom) {
  RowMajor both(top.rows() + bottom.rows(), top.cols());
  both << top, bottom;
  return both;
}

OffsetNetSizes SizesOf(const NetArrays& arrays) {
  const auto channels = [&](const std::string& name) {
    const auto found = arrays.find(name);
    const bool good = found != arrays.end() && !found->second.shape.empty();
    return static_cast<int>(good ? std::clamp<int64_t>(found->second.shape[0], 1, kMostChannels) : 1);
  };
  return {channels("stem.weight"), channels("pose.weight"), channels("geometry"), channels("layer0.weight")};
}

}  // namespace

std::vector<std::pair<std::string, std::vector<int64_t>>> OffsetNetShapes(const OffsetNetSizes& sizes) {
  std::vector<std::pair<std::string, std::vector<int64_t>>> shapes;
  const auto add = [&](const std::string& name, const std::vector<int64_t>& shape) {
    shapes.emplace_back(name + ".weight", shape);
    shapes.emplace_back(name + ".bias", std::vector<int64_t>{shape[0]});
  };
  const int64_t width = sizes.unet_width, features = sizes.pose_channels + sizes.geometry_channels + 5, mlp = sizes.mlp_width;
  add("stem", {width, 3, 3, 3});
  for (int i = 0; i < kOffsetNetDowns; ++i) {
    add("down" + std::to_string(i), {width << (i + 1), width << i, 4, 4});
    add("up" + std::to_string(i), {width << i, (width << (i + 1)) + (width << i), 3, 3});
  }
  add("pose", {sizes.pose_channels, width, 1, 1});
  shapes.emplace_back("geometry", std::vector<int64_t>{sizes.geometry_channels, OffsetAtlas::kHeight, OffsetAtlas::kWidth});
  shapes.emplace_back("mean", std::vector<int64_t>{3, OffsetAtlas::kHeight, OffsetAtlas::kWidth});
  shapes.emplace_back("spread", std::vector<int64_t>{1});
  for (int i = 0; i < kOffsetNetLayers; ++i)
    add("layer" + std::to_string(i), {mlp, i == 0 ? features : i == kOffsetNetSkipAt ? mlp + features : mlp});
  add("head", {3, mlp});
  return shapes;
}

PositionNorm NormOf(const OffsetAtlas& atlas, const std::vector<Eigen::Matrix3Xf>& posed) {
  constexpr float kLeastSpreadM = 0.02f;
  MVS_CHECK(!posed.empty(), "no poses");
  const auto share = 1 / static_cast<float>(posed.size());
  PositionNorm norm{Eigen::Matrix3Xf::Zero(3, OffsetAtlas::kHeight * OffsetAtlas::kWidth)};
  for (const Eigen::Matrix3Xf& one : posed) norm.mean += share * PositionMap(atlas, one);
  double squares = 0;
  for (const Eigen::Matrix3Xf& one : posed) squares += (PositionMap(atlas, one) - norm.mean).squaredNorm();
  const auto count = static_cast<double>(std::max<size_t>(1, 3 * atlas.texels.size() * posed.size()));
  norm.spread = std::max(kLeastSpreadM, static_cast<float>(std::sqrt(squares / count)));
  return norm;
}

Eigen::Matrix3Xf NormalPositions(const OffsetAtlas& atlas, const PositionNorm& norm, const Eigen::Matrix3Xf& posed) {
  constexpr float kMost = 100;
  return ((PositionMap(atlas, posed) - norm.mean) / norm.spread).cwiseMax(-kMost).cwiseMin(kMost);
}

std::optional<NetProblem> ProblemOf(const NetArrays& arrays) {
  const auto shapes = OffsetNetShapes(SizesOf(arrays));
  for (const auto& [name, shape] : shapes) {
    const auto found = arrays.find(name);
    if (found == arrays.end()) return NetProblem{name, "is missing"};
    size_t count = 1;
    for (const int64_t size : shape) count *= static_cast<size_t>(size);
    if (found->second.shape != shape || found->second.values.size() != count)
      return NetProblem{name, "has another shape than this network's"};
    for (const float value : found->second.values) {
      if (!(std::abs(value) <= 1e6f)) return NetProblem{name, "holds a number that is not finite or too large"};
    }
  }
  if (!(arrays.at("spread").values[0] >= 1e-6f)) return NetProblem{"spread", "is not positive"};
  for (const auto& [name, array] : arrays) {
    const auto is = [&](const auto& known) { return known.first == name; };
    if (std::none_of(shapes.begin(), shapes.end(), is)) return NetProblem{name, "is not known"};
  }
  return std::nullopt;
}

OffsetNet::OffsetNet(const BodyTemplate& body, NetArrays arrays)
    : atlas_(MakeOffsetAtlas(body)), smoother_(body, kOffsetNetStiffness), arrays_(std::move(arrays)) {
  const auto problem = ProblemOf(arrays_);
  MVS_CHECK(!problem, problem->array << " " << problem->what);
}

Eigen::Matrix3Xf OffsetNet::At(const Eigen::Matrix3Xf& posed) const {
  MVS_CHECK(posed.cols() == num_vertices(), posed.cols() << " vertices for a network of " << num_vertices());
  const Eigen::Map<const RowMajor> mean(arrays_.at("mean").values.data(), 3, OffsetAtlas::kHeight * OffsetAtlas::kWidth);
  const PositionNorm norm{mean, arrays_.at("spread").values[0]};
  const FeatureMap pose = PoseFeature(arrays_, NormalPositions(atlas_, norm, posed));
  const NetArray& geometry = arrays_.at("geometry");
  const Eigen::Map<const RowMajor> learned(geometry.values.data(), geometry.shape[0], pose.values.cols());
  const RowMajor features = Stacked(Sample(Stacked(pose.values, learned), atlas_.vertex_px), atlas_.coordinates);
  RowMajor y = features;
  for (int i = 0; i < kOffsetNetLayers; ++i) {
    y = Linear(arrays_, "layer" + std::to_string(i), i == kOffsetNetSkipAt ? Stacked(y, features) : y);
    y = y.cwiseMax(static_cast<float>(kOffsetNetLeak) * y).cwiseMax(-kMostActivation).cwiseMin(kMostActivation).eval();
  }
  const RowMajor raw = static_cast<float>(kOffsetNetMostM) * Linear(arrays_, "head", y).array().tanh();
  return smoother_.Apply(raw);
}

}  // namespace mvstudio::body
