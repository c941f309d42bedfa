#include "dataset/detect/tfjs/tfjs_graph.h"

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "core/error.h"
#include "dataset/detect/models/models.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::detect {
namespace {

using nlohmann::json;
using Shape = std::vector<int64_t>;

size_t Count(const Shape& shape) {
  size_t count = 1;
  for (const int64_t size : shape) count *= static_cast<size_t>(size);
  return count;
}

FloatTensor Random(const Shape& shape, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<float> values(-1, 1);
  FloatTensor tensor{shape, std::vector<float>(Count(shape))};
  for (float& value : tensor.values) value = values(generator);
  return tensor;
}

/// Writes the two files of a graph model in memory.
class Model {
 public:
  Model() { root_["modelTopology"]["node"] = json::array(); }

  void Input(const std::string& name, const Shape& shape) {
    json dims = json::array();
    for (const int64_t size : shape) dims.push_back({{"size", std::to_string(size)}});
    Node(name, "Placeholder", {}, {{"shape", {{"shape", {{"dim", dims}}}}}});
  }
  void Weight(const std::string& name, const FloatTensor& tensor) {
    Entry(name, "float32", tensor.shape, {});
    Append(tensor.values.data(), 4 * tensor.values.size());
  }
  void Ints(const std::string& name, const std::vector<int32_t>& values) {
    Ints(name, {static_cast<int64_t>(values.size())}, values);
  }
  void Ints(const std::string& name, const Shape& shape, const std::vector<int32_t>& values) {
    Entry(name, "int32", shape, {});
    Append(values.data(), 4 * values.size());
  }
  template <class T>
  void Quantised(const std::string& name, const std::vector<T>& levels, const json& quantization) {
    Entry(name, "float32", {static_cast<int64_t>(levels.size())}, quantization);
    Append(levels.data(), sizeof(T) * levels.size());
  }
  void Node(const std::string& name, const std::string& op, const std::vector<std::string>& inputs,
            const json& attributes = json::object()) {
    root_["modelTopology"]["node"].push_back({{"name", name}, {"op", op}, {"input", inputs}, {"attr", attributes}});
  }
  TfjsFiles Files(const std::string& output = "out") const {
    json root = root_;
    root["signature"]["outputs"]["o"]["name"] = output + ":0";
    root["weightsManifest"] = json::array({{{"paths", {"w.bin"}}, {"weights", weights_}}});
    return {"net.json", root.dump(), {{"w.bin", bytes_}}};
  }
  json& root() { return root_; }
  std::string& bytes() { return bytes_; }
  json& weights() { return weights_; }

 private:
  void Entry(const std::string& name, const std::string& type, const Shape& shape, const json& quantization) {
    Node(name, "Const", {});
    json entry{{"name", name}, {"shape", shape}, {"dtype", type}};
    if (!quantization.empty()) entry["quantization"] = quantization;
    weights_.push_back(entry);
  }
  void Append(const void* data, size_t size) { bytes_.append(static_cast<const char*>(data), size); }

  json root_ = json::object();
  json weights_ = json::array();
  std::string bytes_;
};

json Four(int64_t y, int64_t x) { return {{"list", {{"i", {"1", std::to_string(y), std::to_string(x), "1"}}}}}; }
const json kSame = {{"s", "U0FNRQ=="}}, kValid = {{"s", "VkFMSUQ="}};

json WindowAttributes(bool same, int64_t sy, int64_t sx, int64_t dilation = 1) {
  return {{"padding", same ? kSame : kValid},
          {"strides", Four(sy, sx)},
          {"dilations", Four(dilation, dilation)},
          {"data_format", {{"s", "TkhXQw=="}}}};
}

/// An axis of a window operation, from TensorFlow's definition.
struct Axis {
  int64_t outputs = 0, before = 0;
  Axis(bool same, int64_t inputs, int64_t window, int64_t stride, int64_t dilation = 1) {
    const int64_t reach = (window - 1) * dilation + 1;
    outputs = same ? (inputs + stride - 1) / stride : (inputs - reach) / stride + 1;
    before = same ? std::max<int64_t>(0, (outputs - 1) * stride + reach - inputs) / 2 : 0;
  }
};

struct Loops {
  bool same = true, depthwise = false;
  int64_t sy = 1, sx = 1, dilation = 1;

  FloatTensor operator()(const FloatTensor& in, const FloatTensor& filter) const {
    const int64_t h = in.shape[1], w = in.shape[2], c = in.shape[3];
    const int64_t kh = filter.shape[0], kw = filter.shape[1], last = filter.shape[3];
    const Axis y(same, h, kh, sy, dilation), x(same, w, kw, sx, dilation);
    const int64_t out_c = depthwise ? c * last : last;
    FloatTensor out{{1, y.outputs, x.outputs, out_c}, std::vector<float>(Count({y.outputs, x.outputs, out_c}), 0)};
    for (int64_t oy = 0; oy < y.outputs; ++oy)
      for (int64_t ox = 0; ox < x.outputs; ++ox)
        for (int64_t fy = 0; fy < kh; ++fy)
          for (int64_t fx = 0; fx < kw; ++fx) {
            const int64_t iy = oy * sy + fy * dilation - y.before, ix = ox * sx + fx * dilation - x.before;
            if (iy < 0 || ix < 0 || iy >= h || ix >= w) continue;
            for (int64_t ic = 0; ic < c; ++ic)
              for (int64_t k = 0; k < last; ++k) {
                const int64_t oc = depthwise ? ic * last + k : k;
                out.values[(oy * x.outputs + ox) * out_c + oc] +=
                    in.values[(iy * w + ix) * c + ic] * filter.values[((fy * kw + fx) * c + ic) * last + k];
              }
          }
    return out;
  }
};

void ExpectNear(const FloatTensor& actual, const FloatTensor& expected, double tolerance = 2e-5) {
  ASSERT_EQ(actual.shape, expected.shape);
  for (size_t i = 0; i < expected.values.size(); ++i) ASSERT_NEAR(actual.values[i], expected.values[i], tolerance) << i;
}

FloatTensor RunOne(const Model& model, const FloatTensor& input) { return TfjsGraph(model.Files()).Run({input})[0]; }

struct Case {
  int64_t height, width, kernel, stride, dilation;
  bool same;
};

class Convolutions : public ::testing::TestWithParam<Case> {};

TEST_P(Convolutions, AreThoseOfTheLoops) {
  const Case& c = GetParam();
  for (const bool depthwise : {false, true}) {
    const FloatTensor in = Random({1, c.height, c.width, 3}, 1), filter = Random({c.kernel, c.kernel, 3, 2}, 2);
    Model model;
    model.Input("in", {1, -1, -1, 3});
    model.Weight("filter", filter);
    model.Node("out", depthwise ? "DepthwiseConv2dNative" : "Conv2D", {"in", "filter"},
               WindowAttributes(c.same, c.stride, c.stride, c.dilation));
    ExpectNear(RunOne(model, in), Loops{c.same, depthwise, c.stride, c.stride, c.dilation}(in, filter));
  }
}

INSTANTIATE_TEST_SUITE_P(SizesAndStrides, Convolutions,
                         ::testing::Values(Case{5, 6, 3, 1, 1, true}, Case{6, 5, 3, 2, 1, true}, Case{7, 8, 3, 2, 1, true},
                                           Case{8, 9, 2, 2, 1, true}, Case{9, 7, 5, 3, 1, true}, Case{9, 8, 3, 1, 2, true},
                                           Case{4, 5, 1, 3, 1, true}, Case{7, 8, 3, 2, 1, false}, Case{9, 8, 3, 1, 2, false}));

TEST(TfjsGraph, FusedConvolutionAddsBiasAndClamps) {
  const FloatTensor in = Random({1, 4, 4, 2}, 3), filter = Random({3, 3, 2, 4}, 4), bias = Random({4}, 5);
  for (const std::string activation : {"", "UmVsdQ==", "UmVsdTY="}) {
    Model model;
    model.Input("in", in.shape);
    model.Weight("filter", filter);
    FloatTensor wide_bias = bias;
    for (float& value : wide_bias.values) value *= 10;
    model.Weight("bias", wide_bias);
    json attributes = WindowAttributes(true, 1, 1);
    attributes["fused_ops"] = {{"list", {{"s", {"Qmlhc0FkZA=="}}}}};
    if (!activation.empty()) attributes["fused_ops"]["list"]["s"].push_back(activation);
    model.Node("out", "_FusedConv2D", {"in", "filter", "bias"}, attributes);
    FloatTensor expected = Loops{}(in, filter);
    for (size_t i = 0; i < expected.values.size(); ++i) {
      float& value = expected.values[i];
      value += wide_bias.values[i % 4];
      if (!activation.empty()) value = std::max(value, 0.0f);
      if (activation == "UmVsdTY=") value = std::min(value, 6.0f);
    }
    ExpectNear(RunOne(model, in), expected);
  }
}

/// The transposed convolution is the adjoint of the convolution: <conv(a), b> = <a, transposed(b)>.
TEST(TfjsGraph, TransposedConvolutionIsTheAdjoint) {
  for (const auto& [size, kernel, stride] : {std::array<int64_t, 3>{8, 2, 2}, {7, 3, 2}, {9, 3, 3}, {8, 5, 2}, {5, 1, 2}}) {
    const int64_t small = (size + stride - 1) / stride;
    const FloatTensor a = Random({1, size, size, 2}, 6), b = Random({1, small, small, 3}, 7),
                      filter = Random({kernel, kernel, 2, 3}, 8);
    Model model;
    model.Input("in", b.shape);
    model.Weight("filter", filter);
    model.Ints("sizes", {1, static_cast<int32_t>(size), static_cast<int32_t>(size), 2});
    model.Node("out", "Conv2DBackpropInput", {"sizes", "filter", "in"}, WindowAttributes(true, stride, stride));
    const FloatTensor up = RunOne(model, b), down = Loops{true, false, stride, stride}(a, filter);
    ASSERT_EQ(up.shape, a.shape);
    ASSERT_EQ(down.shape, b.shape);
    double left = 0, right = 0;
    for (size_t i = 0; i < b.values.size(); ++i) left += static_cast<double>(down.values[i]) * b.values[i];
    for (size_t i = 0; i < a.values.size(); ++i) right += static_cast<double>(up.values[i]) * a.values[i];
    EXPECT_NEAR(left, right, 1e-4) << size << " " << kernel << " " << stride;
  }
}

TEST(TfjsGraph, PoolingLeavesPaddingOut) {
  const FloatTensor in = Random({1, 5, 6, 2}, 9);
  for (const bool mean : {true, false}) {
    Model model;
    model.Input("in", in.shape);
    json attributes = WindowAttributes(true, 2, 2);
    attributes["ksize"] = Four(3, 3);
    model.Node("out", mean ? "AvgPool" : "MaxPool", {"in"}, attributes);
    const Axis y(true, 5, 3, 2), x(true, 6, 3, 2);
    FloatTensor expected{{1, y.outputs, x.outputs, 2}, {}};
    for (int64_t oy = 0; oy < y.outputs; ++oy)
      for (int64_t ox = 0; ox < x.outputs; ++ox)
        for (int64_t c = 0; c < 2; ++c) {
          float sum = 0, most = -10;
          int count = 0;
          for (int64_t iy = std::max<int64_t>(0, oy * 2 - y.before); iy < std::min<int64_t>(5, oy * 2 - y.before + 3); ++iy)
            for (int64_t ix = std::max<int64_t>(0, ox * 2 - x.before); ix < std::min<int64_t>(6, ox * 2 - x.before + 3); ++ix) {
              const float value = in.values[(iy * 6 + ix) * 2 + c];
              sum += value, most = std::max(most, value), ++count;
            }
          expected.values.push_back(mean ? sum / static_cast<float>(count) : most);
        }
    ExpectNear(RunOne(model, in), expected);
  }
}

/// A linear ramp stays one between the outermost samples, wherever those lie.
TEST(TfjsGraph, ResizeHasTheThreeGridsOfTensorFlow) {
  struct Grid {
    bool half_pixel, corners;
    std::vector<float> expected;
  };
  const std::vector<Grid> grids = {{true, false, {0, 0.25f, 0.75f, 1.25f, 1.75f, 2}},
                                   {false, true, {0, 0.4f, 0.8f, 1.2f, 1.6f, 2}},
                                   {false, false, {0, 0.5f, 1, 1.5f, 2, 2}}};
  for (const Grid& grid : grids) {
    Model model;
    model.Input("in", {1, 1, 3, 1});
    model.Ints("size", {1, 6});
    model.Node("out", "ResizeBilinear", {"in", "size"},
               {{"half_pixel_centers", {{"b", grid.half_pixel}}}, {"align_corners", {{"b", grid.corners}}}});
    ExpectNear(RunOne(model, {{1, 1, 3, 1}, {0, 1, 2}}), {{1, 1, 6, 1}, grid.expected}, 1e-6);
  }
}

TEST(TfjsGraph, PadAddsZerosBeforeAndAfterEachDimension) {
  const FloatTensor in = Random({1, 2, 3, 2}, 12);
  const auto padded = [&](const std::vector<int32_t>& sizes) {
    Model model;
    model.Input("in", in.shape);
    model.Ints("sizes", {4, 2}, sizes);
    model.Node("out", "Pad", {"in", "sizes"});
    return RunOne(model, in);
  };
  FloatTensor expected{{1, 5, 4, 3}, std::vector<float>(60, 0.0f)};
  for (int64_t y = 0; y < 2; ++y)
    for (int64_t x = 0; x < 3; ++x)
      for (int64_t c = 0; c < 2; ++c)
        expected.values[static_cast<size_t>(((y + 1) * 4 + x) * 3 + c + 1)] =
            in.values[static_cast<size_t>((y * 3 + x) * 2 + c)];
  ExpectNear(padded({0, 0, 1, 2, 0, 1, 1, 0}), expected, 0);
  EXPECT_THROW(padded({0, 0, -1, 0, 0, 0, 0, 0}), FormatError);
  EXPECT_THROW(padded({0, 0, 1 << 30, 0, 0, 0, 0, 0}), FormatError);
  Model flat;
  flat.Input("in", in.shape);
  flat.Ints("sizes", {0, 0, 1, 1});
  flat.Node("out", "Pad", {"in", "sizes"});
  EXPECT_THROW(RunOne(flat, in), FormatError);
}

TEST(TfjsGraph, ElementwiseOperationsBroadcast) {
  const FloatTensor in = Random({1, 2, 2, 3}, 10), row = Random({3}, 11);
  const auto check = [&](const std::string& op, const std::vector<std::string>& inputs,
                         const std::function<float(float, float)>& f) {
    Model model;
    model.Input("in", in.shape);
    model.Weight("row", row);
    model.Node("out", op, inputs);
    FloatTensor expected = in;
    for (size_t i = 0; i < expected.values.size(); ++i) expected.values[i] = f(in.values[i], row.values[i % 3]);
    ExpectNear(RunOne(model, in), expected, 1e-6);
  };
  check("Add", {"in", "row"}, [](float a, float b) { return a + b; });
  check("AddV2", {"row", "in"}, [](float a, float b) { return a + b; });
  check("Sub", {"in", "row"}, [](float a, float b) { return a - b; });
  check("Mul", {"in", "row"}, [](float a, float b) { return a * b; });
  check("AddN", {"in", "in", "in"}, [](float a, float) { return 3 * a; });
  check("Relu", {"in"}, [](float a, float) { return std::max(a, 0.0f); });
  check("Relu6", {"in"}, [](float a, float) { return std::clamp(a, 0.0f, 6.0f); });
  check("Sigmoid", {"in"}, [](float a, float) { return 1 / (1 + std::exp(-a)); });
  check("Identity", {"^row", "in:0"}, [](float a, float) { return a; });
}

TEST(TfjsGraph, QuantisedWeights) {
  Model model;
  model.Input("in", {4});
  // 1, -2, the smallest subnormal, 65504
  model.Quantised<uint16_t>("half", {0x3c00, 0xc000, 0x0001, 0x7bff}, {{"dtype", "float16"}});
  model.Quantised<uint8_t>("byte", {0, 1, 2, 255}, {{"dtype", "uint8"}, {"scale", 0.5}, {"min", -1}});
  model.Quantised<uint16_t>("word", {0, 1, 2, 65535}, {{"dtype", "uint16"}, {"scale", 0.25}, {"min", 3}});
  model.Node("sum", "AddN", {"in", "half"});
  model.Node("more", "AddN", {"sum", "byte"});
  model.Node("out", "AddN", {"more", "word"});
  ExpectNear(RunOne(model, {{4}, {0, 0, 0, 0}}),
             {{4}, {1 - 1 + 3, -2 - 0.5f + 3.25f, 0 + 3.5f + 5.9604645e-8f, 65504 + 126.5f + 16386.75f}}, 1e-6);
}

TEST(TfjsGraph, InnerNodesCanBeInputsAndOutputs) {
  Model model;
  model.Input("in", {2});
  model.Node("odd", "SomethingNew", {"in"});
  model.Node("a", "Relu", {"odd"});
  model.Node("b", "AddN", {"a", "a"});
  model.Node("out", "SomethingElse", {"b"});
  const TfjsGraph graph(model.Files(), {"odd"}, {"b", "a"});
  const std::vector<FloatTensor> out = graph.Run({{{2}, {-1, 2}}});
  EXPECT_EQ(out[0].values, (std::vector<float>{0, 4}));
  EXPECT_EQ(out[1].values, (std::vector<float>{0, 2}));
  EXPECT_THAT(MessageOf<FormatError>([&] { TfjsGraph whole(model.Files()); }), HasSubstr("node 'odd': operation SomethingNew"));
}

/// A convolution that is in order; each test breaks one thing.
Model Sound() {
  Model model;
  model.Input("in", {1, 4, 4, 3});
  model.Weight("filter", Random({3, 3, 3, 2}, 12));
  model.Node("out", "Conv2D", {"in", "filter"}, WindowAttributes(true, 1, 1));
  return model;
}

std::string Refusal(const Model& model) {
  return MessageOf<FormatError>([&] { RunOne(model, Random({1, 4, 4, 3}, 13)); });
}

TEST(TfjsGraph, RefusesWhatDoesNotFit) {
  Model cut = Sound();
  cut.bytes().pop_back();
  EXPECT_THAT(Refusal(cut), HasSubstr("weight 'filter'"));
  Model longer = Sound();
  longer.bytes() += "x";
  EXPECT_THAT(Refusal(longer), HasSubstr("its files have 217"));
  Model huge = Sound();
  huge.weights()[0]["shape"] = {1 << 20, 1 << 20, 1 << 20, 1 << 20};
  EXPECT_THAT(Refusal(huge), HasSubstr("elements"));
  Model negative = Sound();
  negative.weights()[0]["shape"] = {-3, -3, 3, 2};
  EXPECT_THAT(Refusal(negative), HasSubstr("negative"));
  Model channels = Sound();
  channels.weights()[0]["shape"] = {3, 3, 2, 3};
  EXPECT_THAT(Refusal(channels), HasSubstr("node 'out'"));
  Model type = Sound();
  type.weights()[0]["dtype"] = "complex64";
  EXPECT_THAT(Refusal(type), HasSubstr("complex64"));
  Model nan = Sound();
  const float not_a_number = std::nanf("");
  std::memcpy(nan.bytes().data(), &not_a_number, 4);
  EXPECT_THAT(Refusal(nan), HasSubstr("not finite"));
  Model circle = Sound();
  circle.root()["modelTopology"]["node"][2]["input"] = {"out", "filter"};
  EXPECT_THAT(Refusal(circle), HasSubstr("needs its own output"));
  Model missing = Sound();
  missing.root()["modelTopology"]["node"][2]["input"] = {"in", "nowhere"};
  EXPECT_THAT(Refusal(missing), HasSubstr("nowhere"));
  Model twice = Sound();
  twice.Node("out", "Relu", {"in"});
  EXPECT_THAT(Refusal(twice), HasSubstr("twice"));
  Model stride = Sound();
  stride.root()["modelTopology"]["node"][2]["attr"]["strides"] = Four(0, 1);
  EXPECT_THAT(Refusal(stride), HasSubstr("strides"));
  Model layout = Sound();
  layout.root()["modelTopology"]["node"][2]["attr"]["data_format"] = {{"s", "TkNIVw=="}};
  EXPECT_THAT(Refusal(layout), HasSubstr("NHWC"));
}

TEST(TfjsGraph, RefusesHugeResultsBeforeTheyAreMade) {
  Model resize;
  resize.Input("in", {1, 4, 4, 3});
  resize.Ints("size", {1 << 30, 1 << 30});
  resize.Node("out", "ResizeBilinear", {"in", "size"});
  EXPECT_THAT(Refusal(resize), HasSubstr("elements"));
  Model dilation = Sound();
  dilation.root()["modelTopology"]["node"][2]["attr"]["dilations"] = Four(4000000000, 4000000000);
  EXPECT_THAT(Refusal(dilation), HasSubstr("dilations"));
}

TEST(TfjsGraph, RefusesEveryCutJson) {
  const TfjsFiles whole = Sound().Files();
  for (size_t length = 0; length < whole.json.size(); length += 3) {
    TfjsFiles cut = whole;
    cut.json.resize(length);
    EXPECT_THROW(TfjsGraph{cut}, FormatError) << length;
  }
  TfjsFiles deep = whole;
  deep.json = std::string(100000, '[');
  EXPECT_THROW(TfjsGraph{deep}, FormatError);
}

TEST(TfjsGraph, LongChainsNeedNoStack) {
  Model model;
  model.Input("n0", {1});
  for (int i = 1; i <= 20000; ++i) model.Node("n" + std::to_string(i), "Identity", {"n" + std::to_string(i - 1)});
  EXPECT_EQ(TfjsGraph(model.Files("n20000")).Run({{{1}, {7}}})[0].values[0], 7);
}

TEST(TfjsGraph, WrongInputsAreTheCallersMistake) {
  const TfjsGraph graph(Sound().Files());
  EXPECT_THROW(graph.Run({}), ContractViolation);
  EXPECT_THROW(graph.Run({Random({1, 4, 4, 2}, 1)}), ContractViolation);
  FloatTensor few = Random({1, 4, 4, 3}, 1);
  few.values.pop_back();
  EXPECT_THROW(graph.Run({few}), ContractViolation);
}

TEST(TfjsGraph, InstalledNetsRunAndRepeatThemselves) {
  for (const auto& [name, size] : {std::pair("posenet", 129), {"selfie", 256}}) {
    if (!HasModel(name)) GTEST_SKIP() << "needs the net '" << name << "': mvstudio models fetch";
    const TfjsGraph graph(ReadModel(name));
    FloatTensor in = Random({1, size, size, 3}, 14);
    const std::vector<FloatTensor> once = graph.Run({in}), again = graph.Run({in});
    for (size_t i = 0; i < once.size(); ++i) {
      EXPECT_EQ(once[i].values, again[i].values);
      EXPECT_TRUE(std::all_of(once[i].values.begin(), once[i].values.end(), [](float v) { return std::isfinite(v); })) << name;
    }
  }
}

}  // namespace
}  // namespace mvstudio::detect
