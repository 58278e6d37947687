"""The operator's side: client library and command line. Knows neither ROS nor the gateway's insides."""
