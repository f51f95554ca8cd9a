"""`dcmg report`: everything a recorded run says about detection, as one web page and one JSON document."""
