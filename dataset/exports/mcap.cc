#include <cmath>

#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/exports/joint_files.h"
#include "dataset/exports/mcap_file.h"

/// One MCAP file with messages of ROS 2: where the cameras stand, their lenses and images, the joints of each person.
namespace mvstudio::exports {
namespace {

#define MVS_ROS_LINE "================================================================================\n"
#define MVS_ROS_HEADER                                                                               \
  MVS_ROS_LINE "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" MVS_ROS_LINE \
               "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"

constexpr RosSchema kTransforms{
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/TransformStamped[] transforms\n" MVS_ROS_LINE
    "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform "
    "transform\n" MVS_ROS_LINE
    "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n" MVS_ROS_LINE
    "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n" MVS_ROS_LINE
    "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n" MVS_ROS_HEADER};
constexpr RosSchema kLens{
    "sensor_msgs/msg/CameraInfo",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] "
    "r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n" MVS_ROS_LINE
    "MSG: sensor_msgs/RegionOfInterest\nuint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool "
    "do_rectify\n" MVS_ROS_HEADER};
constexpr RosSchema kImage{"sensor_msgs/msg/CompressedImage",
                           "std_msgs/Header header\nstring format\nuint8[] data\n" MVS_ROS_HEADER};
constexpr RosSchema kPoints{
    "sensor_msgs/msg/PointCloud2",
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\nuint32 "
    "point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n" MVS_ROS_LINE
    "MSG: sensor_msgs/PointField\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n" MVS_ROS_HEADER};
#undef MVS_ROS_LINE
#undef MVS_ROS_HEADER

constexpr char kWorld[] = "world";
constexpr uint8_t kFloat32 = 7;  // of sensor_msgs/PointField

CdrMessage TransformsOf(const Take& take, int64_t time_ns) {
  CdrMessage message;
  message.Add(static_cast<uint32_t>(take.views.size()));
  for (const View& view : take.views) {
    const geometry::Rigid3 world_from_cam = Inverse(view.camera.cam_from_world);
    message.AddHeader(time_ns, kWorld).AddText(view.info.name);
    for (int k = 0; k < 3; ++k) message.Add(world_from_cam.translation[k]);
    for (int k = 0; k < 4; ++k) message.Add(world_from_cam.rotation.coeffs()[k]);
  }
  return message;
}

CdrMessage LensOf(const View& view, int64_t time_ns) {
  const geometry::Camera& lens = view.camera.camera;
  CdrMessage message;
  message.AddHeader(time_ns, view.info.name).Add(static_cast<uint32_t>(lens.height_px));
  message.Add(static_cast<uint32_t>(lens.width_px)).AddText("plumb_bob");
  message.Add(uint32_t{5});
  for (int k = 0; k < 5; ++k) message.Add(0.0);
  const std::vector<double> m = MatrixOf(lens);
  for (const double value : m) message.Add(value);
  for (int k = 0; k < 9; ++k) message.Add(k % 4 == 0 ? 1.0 : 0.0);
  for (size_t k = 0; k < 9; ++k) {
    message.Add(m[k]);
    if (k % 3 == 2) message.Add(0.0);
  }
  for (int k = 0; k < 6; ++k) message.Add(uint32_t{0});  // binning, region of interest
  return message.Add(uint8_t{0});
}

CdrMessage PointsOf(const dataset::JointsPose& pose, int64_t time_ns) {
  std::string data;
  uint32_t count = 0;
  for (size_t j = 0; j < pose.valid.size(); ++j) {
    if (!pose.valid[j]) continue;
    ++count;
    for (int k = 0; k < 3; ++k) {
      const auto value = static_cast<float>(pose.x_in_world(k, static_cast<Eigen::Index>(j)));
      data.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
  }
  constexpr uint32_t kPointBytes = 12;
  CdrMessage message;
  message.AddHeader(time_ns, kWorld).Add(uint32_t{1}).Add(count).Add(uint32_t{3});
  for (uint32_t k = 0; k < 3; ++k)
    message.AddText(std::string(1, static_cast<char>('x' + k))).Add(4 * k).Add(kFloat32).Add(uint32_t{1});
  message.Add(uint8_t{0}).Add(kPointBytes).Add(kPointBytes * count).AddBytes(data);
  return message.Add(uint8_t{1});
}

CdrMessage ImageOf(const std::string& encoded, const std::string& camera, int64_t time_ns) {
  CdrMessage message;
  const bool is_png = !encoded.empty() && static_cast<unsigned char>(encoded[0]) == 0x89;
  message.AddHeader(time_ns, camera).AddText(is_png ? "png" : "jpeg").AddBytes(encoded);
  return message;
}

class TakeMessages {
 public:
  TakeMessages(const Job& job, McapFile* file) : job_(job), file_(*file) {
    const bool has_images = job.options.images != ExportImages::kNone;
    transforms_ = file_.AddChannel("/tf_static", kTransforms);
    for (const View& view : job.take.views) {
      lenses_.push_back(file_.AddChannel("/" + view.info.name + "/camera_info", kLens));
      if (has_images) images_.push_back(file_.AddChannel("/" + view.info.name + "/image", kImage));
    }
    for (const int person : job.take.PersonIds())
      people_[person] = file_.AddChannel("/person_" + std::to_string(person) + "/joints", kPoints);
  }

  void AddCameras(int64_t time_ns) {
    file_.Add(transforms_, time_ns, TransformsOf(job_.take, time_ns));
    for (size_t i = 0; i < lenses_.size(); ++i) file_.Add(lenses_[i], time_ns, LensOf(job_.take.views[i], time_ns));
  }

  void AddFrame(int frame, int64_t time_ns) {
    for (size_t i = 0; i < images_.size(); ++i) {
      const std::string encoded = job_.images.EncodedImage(i, frame);
      if (!encoded.empty()) file_.Add(images_[i], time_ns, ImageOf(encoded, job_.take.views[i].info.name, time_ns));
    }
    for (const auto& [person, channel] : people_) {
      if (const auto pose = JointsOf(job_.take, frame, person)) file_.Add(channel, time_ns, PointsOf(*pose, time_ns));
    }
  }

 private:
  const Job& job_;
  McapFile& file_;
  uint16_t transforms_ = 0;
  std::vector<uint16_t> lenses_, images_;
  std::map<int, uint16_t> people_;
};

}  // namespace

void WriteMcap(const Job& job) {
  const std::string name = job.take.sequence + ".mcap";
  AtomicFile place(job.file.empty() ? job.folder + "/" + name : job.file);
  McapFile file(place.temporary());
  TakeMessages messages(job, &file);
  const auto time_of = [&](int frame) { return static_cast<int64_t>(std::llround(1e9 * frame / job.take.frame_rate_hz)); };
  messages.AddCameras(job.take.frames.empty() ? 0 : time_of(job.take.frames.front()));
  for (const int frame : job.take.frames) {
    if (job.run.progress && job.run.progress->Cancelled()) throw CancelledError("interrupted; nothing was written");
    messages.AddFrame(frame, time_of(frame));
  }
  file.Finish();
  job.images.RequireAny();
  place.Commit();
  job.report->files.push_back(name);
}

}  // namespace mvstudio::exports
