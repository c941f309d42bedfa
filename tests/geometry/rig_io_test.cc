#include "geometry/rig/rig_io.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/log.h"
#include "core/random.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/cpu_time.h"
#include "tests/support/sanitized.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

Rig SampleRig() {
  Rng rng(1);
  Rig rig;
  rig.gauge = RigGauge::OfCamera("\"pinhole\", \n in UTF-8: ü");
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const SplineGrid smallest = {camera.spline.order, camera.spline.order + 2, camera.spline.order + 1, 100};
    RigCamera entry;
    entry.camera = camera.model == LensModel::kSplined ? testing::MakeSplined(smallest, 0.01) : camera;
    entry.cam_from_world = {RotationExp(Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())),
                            Eigen::Vector3d(rng.Normal(), 1e-310, -1e17 / 3)};
    if (rig.cameras.size() % 2) {
      const Eigen::MatrixXd a = Eigen::MatrixXd::NullaryExpr(entry.camera.params.size(), 20, [&] { return rng.Normal(); });
      entry.params_covariance = a * a.transpose();
      const Eigen::MatrixXd b = Eigen::MatrixXd::NullaryExpr(6, 20, [&] { return 1e-5 * rng.Normal(); });
      entry.cam_from_world_covariance = b * b.transpose();
    }
    rig.cameras.push_back(entry);
  }
  return rig;
}

/// Four cameras, one of them splined.
Rig SmallRig() {
  const Rig all = SampleRig();
  Rig rig;
  for (const size_t i : {size_t{0}, size_t{3}, size_t{6}, size_t{17}}) rig.cameras.push_back(all.cameras.at(i));
  return rig;
}

bool SameBits(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() && std::memcmp(a.data(), b.data(), sizeof(double) * a.size()) == 0;
}

void ExpectSame(const Rig& a, const Rig& b) {
  EXPECT_EQ(a.gauge, b.gauge);
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (size_t i = 0; i < a.cameras.size(); ++i) {
    const RigCamera &x = a.cameras[i], &y = b.cameras[i];
    EXPECT_EQ(x.camera.name, y.camera.name);
    EXPECT_EQ(x.camera.model, y.camera.model);
    EXPECT_TRUE(x.camera.spline == y.camera.spline);
    EXPECT_EQ(x.camera.width_px, y.camera.width_px);
    EXPECT_EQ(x.camera.height_px, y.camera.height_px);
    EXPECT_TRUE(SameBits(x.camera.params, y.camera.params));
    EXPECT_TRUE(SameBits(x.cam_from_world.rotation.coeffs(), y.cam_from_world.rotation.coeffs()));
    EXPECT_TRUE(SameBits(x.cam_from_world.translation, y.cam_from_world.translation));
    ASSERT_EQ(x.params_covariance.has_value(), y.params_covariance.has_value());
    ASSERT_EQ(x.cam_from_world_covariance.has_value(), y.cam_from_world_covariance.has_value());
    if (x.params_covariance) {
      EXPECT_TRUE(SameBits(*x.params_covariance, *y.params_covariance));
    }
    if (x.cam_from_world_covariance) {
      EXPECT_TRUE(SameBits(*x.cam_from_world_covariance, *y.cam_from_world_covariance));
    }
  }
}

TEST(RigIo, EveryBitSurvives) {
  const mvstudio::testing::TempDir folder;
  const Rig rig = SampleRig();
  WriteRig(rig, folder / "sub/calibration.json");
  const Rig back = ReadRig(folder / "sub/calibration.json");
  ExpectSame(rig, back);
  EXPECT_EQ(RigToJsonText(back), RigToJsonText(rig));
}

/// The message of the FormatError that `text` earns; "accepted" when it earns none.
std::string Complaint(const std::string& text) {
  try {
    RigFromJsonText(text, "calib.json");
  } catch (const FormatError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(RigIo, EveryTruncationIsAFormatError) {
  std::string text = RigToJsonText(SmallRig());
  text.erase(text.find_last_of('}'));
  for (size_t length = 0; length <= text.size(); length += length < 600 ? 1 : 13) {
    ASSERT_NE(Complaint(text.substr(0, length)), "accepted") << length;
  }
}

TEST(RigIo, MutatedBytesNeverCrash) {
  const std::string text = RigToJsonText(SmallRig());
  Rng rng(2);
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string mutated = text;
    for (int j = 0; j <= i % 3; ++j) mutated[rng.Index(static_cast<int64_t>(text.size()))] = static_cast<char>(rng.Index(256));
    try {
      const Rig rig = RigFromJsonText(mutated, "calib.json");
      for (const RigCamera& camera : rig.cameras) EXPECT_NO_THROW(Validate(camera.camera));
    } catch (const FormatError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000);
}

/// The text with one change made by `edit` on its JSON.
template <class Edit>
std::string Edited(const Edit& edit) {
  nlohmann::json json = nlohmann::json::parse(RigToJsonText(SampleRig()));
  edit(json);
  return json.dump();
}

TEST(RigIo, ErrorsNameThePlace) {
  const auto expect = [](const std::string& text, const std::string& place) {
    const std::string complaint = Complaint(text);
    EXPECT_EQ(complaint.rfind("calib.json: " + place + ": ", 0), 0u) << complaint;
    EXPECT_EQ(complaint.find('\n'), std::string::npos) << complaint;
  };
  expect(Edited([](auto& j) { j["schema"] = "mvstudio.calibration/2"; }), "schema");
  expect(Edited([](auto& j) { j["unit"] = "mm"; }), "unit");
  expect(Edited([](auto& j) { j["cameras"] = 3; }), "cameras");
  expect(Edited([](auto& j) { j["cameras"] = nlohmann::json::array(); }), "cameras");
  expect(Edited([](auto& j) { j["cameras"][3]["intrinsics"]["fx"] = "900"; }), "cameras[3].intrinsics.fx");
  expect(Edited([](auto& j) { j["cameras"][3]["intrinsics"]["fy"] = -1; }), "cameras[3].intrinsics.fy");
  expect(Edited([](auto& j) { j["cameras"][3]["intrinsics"].erase("cx"); }), "cameras[3].intrinsics");
  expect(Edited([](auto& j) { j["cameras"][3]["intrinsics"]["k3"] = 0.1; }), "cameras[3].intrinsics");
  expect(Edited([](auto& j) { j["cameras"][1]["model"] = "fov"; }), "cameras[1].model");
  expect(Edited([](auto& j) { j["cameras"][1]["name"] = ""; }), "cameras[1].name");
  expect(Edited([](auto& j) { j["cameras"][1]["name"] = j["cameras"][0]["name"]; }), "cameras[1].name");
  expect(Edited([](auto& j) { j["cameras"][1].erase("size_px"); }), "cameras[1]");
  expect(Edited([](auto& j) { j["cameras"][1]["size_px"][0] = 0; }), "cameras[1].size_px[0]");
  expect(Edited([](auto& j) { j["cameras"][1]["size_px"][1] = 1e300; }), "cameras[1].size_px[1]");
  expect(Edited([](auto& j) { j["cameras"][1]["size_px"] = {1, 2, 3}; }), "cameras[1].size_px");
  expect(Edited([](auto& j) {
           j["cameras"][2]["cam_from_world"]["rotation_xyzw"] = {0, 0, 0, 0};
         }),
         "cameras[2].cam_from_world.rotation_xyzw");
  expect(Edited([](auto& j) {
           j["cameras"][2]["cam_from_world"]["rotation_xyzw"] = {0, 0, 0, 1e-160};
         }),
         "cameras[2].cam_from_world.rotation_xyzw");
  expect(Edited([](auto& j) { j["cameras"][2]["cam_from_world"]["translation"][2] = nullptr; }),
         "cameras[2].cam_from_world.translation[2]");
  expect(Edited([](auto& j) { j["cameras"][1]["intrinsics_covariance"][0][0] = -1; }), "cameras[1].intrinsics_covariance");
  expect(Edited([](auto& j) { j["cameras"][1]["cam_from_world_covariance"][0][1] = 1; }),
         "cameras[1].cam_from_world_covariance");
  expect(Edited([](auto& j) { j["cameras"][1]["cam_from_world_covariance"].erase(0); }),
         "cameras[1].cam_from_world_covariance");
}

TEST(RigIo, ErrorsOfSplinedLensesNameThePlace) {
  const std::vector<Camera> lenses = testing::OrdinaryLenses();
  const auto is_splined = [](const Camera& lens) { return lens.model == LensModel::kSplined; };
  const auto splined = static_cast<size_t>(std::find_if(lenses.begin(), lenses.end(), is_splined) - lenses.begin());
  const auto place = [&](const auto& edit) {
    const std::string complaint = Complaint(Edited([&](auto& j) { edit(j["cameras"][splined]); }));
    return complaint.substr(0, complaint.find(": ", std::string("calib.json: ").size()));
  };
  const std::string camera = "calib.json: cameras[" + std::to_string(splined) + "]";
  EXPECT_EQ(place([](auto& c) { c.erase("spline"); }), camera);
  EXPECT_EQ(place([](auto& c) { c["spline"]["order"] = 4; }), camera + ".spline");
  EXPECT_EQ(place([](auto& c) { c["spline"]["cols"] = 1 << 29; }), camera + ".spline");
  EXPECT_EQ(place([](auto& c) { c["spline"]["cols"] = 1e30; }), camera + ".spline.cols");
  EXPECT_EQ(place([](auto& c) { c["spline"]["rows"] = 2.5; }), camera + ".spline.rows");
  EXPECT_EQ(place([](auto& c) { c["spline"]["fov_x_deg"] = 400; }), camera + ".spline");
  EXPECT_EQ(place([](auto& c) { c["intrinsics"]["control_points"].erase(0); }), camera + ".intrinsics.control_points");
  EXPECT_EQ(place([](auto& c) { c["intrinsics"]["control_points"][3] = "a"; }), camera + ".intrinsics.control_points[3]");
  EXPECT_EQ(place([](auto& c) { c["intrinsics"]["k1"] = 0; }), camera + ".intrinsics");
  EXPECT_NE(
      Complaint(Edited([](auto& j) { j["cameras"][3]["spline"] = j["cameras"][17]["spline"]; })).find("cameras[3].spline"),
      std::string::npos);
  EXPECT_NE(Complaint(Edited([](auto& j) { j["cameras"][8]["intrinsics"]["xi"] = -1; })).find("cameras[8].intrinsics: xi"),
            std::string::npos);
}

TEST(RigIo, HostileTexts) {
  EXPECT_NE(Complaint(std::string(100000, '[')), "accepted");
  EXPECT_NE(Complaint("{\"schema\":" + std::string(100000, '[') + std::string(100000, ']') + "}"), "accepted");
  EXPECT_NE(Complaint(""), "accepted");
  EXPECT_NE(Complaint("null"), "accepted");
  EXPECT_NE(Complaint("[1, 2]"), "accepted");
  EXPECT_NE(Complaint("\xff\xfe{}"), "accepted");
  EXPECT_NE(Complaint("{\"schema\": \"a\", \"schema\": \"b\"}").find("twice"), std::string::npos);
  std::string text = RigToJsonText(SampleRig());
  const auto with = [&](const std::string& number) {
    std::string changed = text;
    const size_t at = changed.find("\"cx\":") + 5;
    return changed.replace(at, changed.find(',', at) - at, number);
  };
  EXPECT_EQ(Complaint(with("640")), "accepted");
  for (const char* number : {"NaN", "Infinity", "-inf", "1e400", "0x12", "", "1,5", "--1"})
    EXPECT_NE(Complaint(with(number)), "accepted") << number;
}

TEST(RigIo, UnknownKeysAreIgnoredWithAWarning) {
  std::string logged;
  const LogSink before = SetLogSink([&](LogLevel, const std::string& line) { logged += line; });
  const std::string text = Edited([](auto& j) { j["cameras"][4]["colour"] = "red"; });
  EXPECT_EQ(Complaint(text), "accepted");
  SetLogSink(before);
  EXPECT_NE(logged.find("cameras[4].colour"), std::string::npos) << logged;
}

TEST(RigIo, RoundedRotationsArePutBackOnTheSphere) {
  const std::string text = Edited([](auto& j) {
    j["cameras"][0]["cam_from_world"]["rotation_xyzw"] = {0.5, 0.5, 0.5, 0.5001};
  });
  EXPECT_NEAR(RigFromJsonText(text, "t").cameras[0].cam_from_world.rotation.norm(), 1, 1e-15);
}

TEST(RigIo, RefusesToWriteNonsense) {
  const auto expect_refused = [](auto&& spoil) {
    Rig rig = SampleRig();
    spoil(rig);
    EXPECT_THROW(RigToJsonText(rig), ContractViolation);
  };
  expect_refused([](Rig& r) { r.cameras.clear(); });
  expect_refused([](Rig& r) { r.cameras[1].camera.name = r.cameras[0].camera.name; });
  expect_refused([](Rig& r) { r.cameras[1].camera.params[0] = std::nan(""); });
  expect_refused([](Rig& r) { r.cameras[1].cam_from_world.rotation.coeffs() *= 2; });
  expect_refused([](Rig& r) { r.cameras[1].cam_from_world.translation[0] = std::numeric_limits<double>::infinity(); });
  expect_refused([](Rig& r) { r.cameras[1].params_covariance = Eigen::MatrixXd::Zero(3, 3); });
}

TEST(RigIo, NamesThatNoLineCanHold) {
  for (const std::string& name : {std::string("a\x1b[2J"), std::string("a\nb"), std::string("\x7f"), std::string(201, 'x')}) {
    const std::string complaint = Complaint(Edited([&](auto& j) { j["cameras"][2]["name"] = name; }));
    EXPECT_EQ(complaint.rfind("calib.json: cameras[2].name: ", 0), 0u) << complaint;
    EXPECT_EQ(complaint.find_first_of("\x1b\n\x7f"), std::string::npos) << complaint;
    EXPECT_LT(complaint.size(), 200u);
    Rig rig = SampleRig();
    rig.cameras[1].camera.name = name;
    EXPECT_THROW(RigToJsonText(rig), UsageError);
  }
  EXPECT_EQ(Complaint(Edited([](auto& j) { j["cameras"][2]["name"] = std::string(200, 'x'); })), "accepted");
  Rig rig = SampleRig();
  rig.cameras[1].camera.name = "\xff\xfe";
  EXPECT_THROW(RigToJsonText(rig), UsageError);
}

TEST(RigIo, ManyUnknownKeysAreCounted) {
  std::vector<std::string> logged;
  const LogSink before = SetLogSink([&](LogLevel, const std::string& line) { logged.push_back(line); });
  const std::string text = Edited([](auto& j) {
    for (int i = 0; i < 100; ++i) j["key" + std::to_string(i)] = i;
    j["cameras"][1]["a\nb"] = 0;
  });
  EXPECT_EQ(Complaint(text), "accepted");
  SetLogSink(before);
  ASSERT_EQ(logged.size(), 9u);
  EXPECT_EQ(logged.back(), "calib.json: and 93 more unknown keys, ignored");
}

/// `head`, as many items as 10 MB hold, and `tail`.
template <class Item>
std::string TenMegabytes(const std::string& head, const Item& item, const std::string& tail) {
  std::string text = head;
  for (int i = 0; text.size() < (10u << 20); ++i) text += (i ? "," : "") + item(i);
  return text + tail;
}

// Quadratic reading of any of these takes many minutes.
TEST(RigIo, TenMegabytesAreAnsweredAtOnce) {
  const double start = mvstudio::testing::CpuSeconds();
  const std::string rig = RigToJsonText(SmallRig()), head = "{\"schema\": \"mvstudio.calibration/1\", \"unit\": \"m\", ";
  const auto key = [](int i) { return "\"k" + std::to_string(i) + "\": 0"; };
  const auto empty = [](int) { return std::string("{}"); };
  EXPECT_EQ(Complaint(TenMegabytes("{", key, "," + rig.substr(1))), "accepted");
  EXPECT_EQ(Complaint(TenMegabytes("{\"gauge2\": [", empty, "]," + rig.substr(1))), "accepted");
  EXPECT_NE(Complaint(TenMegabytes(head + "\"cameras\": [", empty, "]}")), "accepted");
  EXPECT_NE(Complaint(TenMegabytes("[", empty, "]")), "accepted");
  EXPECT_NE(Complaint(TenMegabytes(
                "", [](int) { return std::string("[[[[]]]]"); }, "")),
            "accepted");
  const RigCamera plain = SampleRig().cameras[0];
  Rig many;
  for (int i = 0; i < 20000; ++i) {
    many.cameras.push_back(plain);
    many.cameras.back().camera.name = "camera with a name that is not short " + std::to_string(i);
  }
  EXPECT_EQ(Complaint(RigToJsonText(many)), "accepted");
  EXPECT_LT(mvstudio::testing::CpuSeconds() - start, mvstudio::testing::kSanitized ? 300 : 20);
}

TEST(RigIo, MissingFileIsAnIoError) {
  const mvstudio::testing::TempDir folder;
  EXPECT_THROW(ReadRig(folder / "none.json"), IoError);
  EXPECT_THROW(ReadRig(folder.path()), IoError);
}

TEST(Rig, FindsByName) {
  const Rig rig = SampleRig();
  EXPECT_EQ(rig.Find("brown4"), 3);
  EXPECT_EQ(rig.Find("none"), -1);
  const Eigen::Vector3d centre = rig.cameras[2].CenterInWorld();
  EXPECT_TRUE(centre.allFinite());
}

TEST(Rig, NamesItsCamerasInOrder) {
  Rig rig;
  EXPECT_TRUE(CameraNames(rig).empty());
  for (const char* name : {"b", "a", "c"}) rig.cameras.push_back({MakePinhole(name, 10, 10, 10), {}, {}, {}});
  EXPECT_EQ(CameraNames(rig), (std::vector<std::string>{"b", "a", "c"}));
  EXPECT_EQ(CameraNames(std::vector<Camera>{rig.cameras[1].camera}), std::vector<std::string>{"a"});
}

}  // namespace
}  // namespace mvstudio::geometry
